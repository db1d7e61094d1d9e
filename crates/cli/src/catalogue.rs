//! All registries: what `list` and `show` print, and the README's tables.

use seafix_component::Listing;
use seafix_experiment::components;

/// One kind of component: its plural and its components.
pub(crate) struct Kind {
    pub(crate) singular: &'static str,
    pub(crate) plural: &'static str,
    pub(crate) listings: Vec<Listing>,
}

/// All kinds, in the order in which a frame meets them.
pub(crate) fn kinds() -> Vec<Kind> {
    let kind = |listings: Vec<Listing>| {
        let singular = listings.first().map_or("", |listing| listing.kind);
        Kind { singular, plural: plural(singular), listings }
    };
    components().into_iter().map(kind).collect()
}

fn plural(kind: &str) -> &'static str {
    match kind {
        "source" => "sources",
        "filter" => "filters",
        "detector" => "detectors",
        "locator" => "locators",
        "descriptor" => "descriptors",
        "matcher" => "matchers",
        "refinement" => "refinements",
        "triangulator" => "triangulators",
        "search" => "searches",
        "solver" => "solvers",
        "odometry" => "odometries",
        "policy" => "policies",
        "fusion" => "fusions",
        _ => "components",
    }
}

/// The kind of this name, in the singular.
pub(crate) fn kind_of(singular: &str) -> Kind {
    kinds().into_iter().find(|kind| kind.singular == singular).expect("every kind of component is in the catalogue")
}

/// The README's tables, between its markers.
pub(crate) fn markdown() -> String {
    let mut text = String::new();
    for kind in kinds() {
        text += &format!("| {} | what it does | literature |\n|---|---|---|\n", kind.singular);
        for listing in kind.listings {
            text += &format!("| `{}` | {} | {} |\n", listing.name, listing.summary, listing.source);
        }
        text += "\n";
    }
    text.trim_end().to_owned() + "\n"
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    /// Holds the part of the README below the line `begin` against `fresh`, or writes it there.
    fn readme_says(begin: &str, end: &str, fresh: &str) {
        let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md");
        let text = fs::read_to_string(&readme).unwrap();
        let from = text.find(begin).expect("the README has the begin marker") + begin.len();
        let to = from + text[from..].find(end).expect("the README has the end marker");
        if std::env::var_os("SEAFIX_UPDATE").is_some() {
            fs::write(readme, format!("{}{fresh}{}", &text[..from], &text[to..])).unwrap();
        } else {
            assert_eq!(&text[from..to], fresh, "run the tests once with SEAFIX_UPDATE=1");
        }
    }

    #[test]
    fn the_readme_tells_what_the_registries_hold_and_what_was_measured() {
        let components = super::markdown();
        readme_says("<!-- components: `seafix list --markdown` -->\n", "<!-- end of components -->", &components);
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reports/virtual-direct");
        let summary = fs::read_to_string(folder.join("summary.txt")).unwrap();
        let results = summary.split("\n\n").next().unwrap().trim_end();
        readme_says(
            "<!-- reports/virtual-direct/summary.txt -->\n",
            "<!-- end of summary -->",
            &format!("```\n{results}\n```\n"),
        );
        let found = fs::read_to_string(folder.join("../README.md")).unwrap();
        readme_says("<!-- reports/README.md -->\n", "<!-- end of reports -->", &gallery(&found));
    }

    /// The questions and main figures of the page of all reports, two beside each other.
    fn gallery(found: &str) -> String {
        let cell = |section: &str| {
            let (name, text) = section.split_once('\n').unwrap();
            let question = text.lines().find_map(|line| line.strip_prefix('*')?.strip_suffix('*')).unwrap();
            let figure =
                text.lines().find_map(|line| Some(line.strip_prefix("[![")?.split_once("](")?.1.split_once(')')?.0));
            let link = format!("reports/{name}/report.html");
            let image = figure.map_or_else(String::new, |figure| {
                format!("<a href=\"{link}\"><img src=\"reports/{figure}\" width=\"400\" alt=\"The main figure of {name}\"></a><br>")
            });
            format!(
                "<td width=\"50%\" valign=\"top\">{image}<a href=\"{link}\">{}</a></td>",
                question.replace('\\', "")
            )
        };
        let cells: Vec<String> = found.split("\n## ").skip(1).map(cell).collect();
        let rows: String = cells.chunks(2).map(|pair| format!("<tr>{}</tr>\n", pair.concat())).collect();
        format!("<table>\n{rows}</table>\n")
    }

    #[test]
    fn lists_are_in_alphabetical_order() {
        for kind in super::kinds() {
            assert!(kind.listings.is_sorted_by_key(|listing| listing.name), "{}", kind.plural);
        }
    }
}
