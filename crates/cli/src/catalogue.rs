//! The catalogue of all registries, for `list`, `show` and the tables of `docs/components.md`.

use seafix_component::Listing;
use seafix_experiment::components;

/// A kind of component with its names and components.
pub(crate) struct Kind {
    pub(crate) singular: &'static str,
    pub(crate) plural: String,
    pub(crate) listings: Vec<Listing>,
}

/// All kinds, in the order of the stages.
pub(crate) fn kinds() -> Vec<Kind> {
    let kind = |listings: Vec<Listing>| {
        let singular = listings.first().map_or("", |listing| listing.kind);
        Kind { singular, plural: plural(singular), listings }
    };
    components().into_iter().map(kind).collect()
}

fn plural(kind: &str) -> String {
    match kind.strip_suffix('y') {
        Some(stem) => format!("{stem}ies"),
        None if kind.ends_with("ch") => format!("{kind}es"),
        None => format!("{kind}s"),
    }
}

/// The kind with this singular name.
pub(crate) fn kind_of(singular: &str) -> Kind {
    kinds().into_iter().find(|kind| kind.singular == singular).expect("every kind of component is in the catalogue")
}

/// The tables of `docs/components.md`, between its markers.
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

    use clap::CommandFactory;

    /// Compares the part of a page between `begin` and `end` with `fresh`, or writes it there.
    fn holds(page: &str, begin: &str, end: &str, fresh: &str) {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(page);
        let text = fs::read_to_string(&page).unwrap();
        let from = text.find(begin).expect("the page has the begin marker") + begin.len();
        let to = from + text[from..].find(end).expect("the page has the end marker");
        if std::env::var_os("SEAFIX_UPDATE").is_some() {
            fs::write(page, format!("{}{fresh}{}", &text[..from], &text[to..])).unwrap();
        } else {
            assert_eq!(&text[from..to], fresh, "run the tests once with SEAFIX_UPDATE=1");
        }
    }

    #[test]
    fn the_documentation_lists_the_registries() {
        let begin = "<!-- components: `seafix list --markdown` -->\n";
        holds("docs/components.md", begin, "<!-- end of components -->", &super::markdown());
    }

    #[test]
    fn the_documentation_lists_the_settings() {
        let begin = "<!-- settings: `seafix show NAME` -->\n";
        holds("docs/settings.md", begin, "<!-- end of settings -->", &crate::settings::markdown());
    }

    #[test]
    fn the_documentation_lists_the_quantities() {
        let begin = "<!-- quantities: `seafix_log::quantities` -->\n";
        holds("docs/quantities.md", begin, "<!-- end of quantities -->", &seafix_log::quantities::markdown());
    }

    #[test]
    fn the_documentation_lists_the_commands() {
        let begin = "<!-- commands: `seafix --help` -->\n";
        let program = crate::commands::Arguments::command();
        holds("docs/commands.md", begin, "<!-- end of commands -->", &crate::reference::markdown(&program));
    }

    #[test]
    fn the_documentation_has_a_gallery_of_the_reports() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let fresh = crate::gallery::markdown(&root.join("reports")).unwrap();
        assert!(fresh.matches("\n## ").count() > 20, "{fresh}");
        holds("docs/gallery.md", "<!-- reports: reports/README.md -->\n", "<!-- end of reports -->", &fresh);
        let figures = crate::gallery::figures(&root.join("reports")).unwrap();
        for (name, figure) in &figures {
            let copy = root.join("docs/gallery").join(name);
            if std::env::var_os("SEAFIX_UPDATE").is_some() {
                fs::write(&copy, figure).unwrap();
            }
            let same = fs::read_to_string(&copy).is_ok_and(|text| text == *figure);
            assert!(same, "{}: run the tests once with SEAFIX_UPDATE=1", copy.display());
        }
        // No figure of a report that is no longer published.
        assert_eq!(fs::read_dir(root.join("docs/gallery")).unwrap().count(), figures.len());
    }

    #[test]
    fn the_readme_has_the_published_table() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reports/virtual-direct");
        let summary = fs::read_to_string(folder.join("summary.txt")).unwrap();
        let results = summary.split("\n\n").next().unwrap().trim_end();
        let begin = "<!-- reports/virtual-direct/summary.txt -->\n";
        holds("README.md", begin, "<!-- end of summary -->", &format!("```\n{results}\n```\n"));
    }

    /// Every number with a decimal point in a finding is in the answer of the linked report.
    /// Seen to fail with a digit changed.
    #[test]
    fn the_readme_repeats_the_published_findings() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let readme = fs::read_to_string(root.join("README.md")).unwrap();
        let published = fs::read_to_string(root.join("reports/README.md")).unwrap();
        let findings = readme.split_once("## What we found\n").unwrap().1.split_once("\n| | |").unwrap().0;
        let findings: Vec<String> = findings.split("\n- ").skip(1).map(|finding| finding.replace('\n', " ")).collect();
        assert_eq!(findings.len(), 5);
        for finding in findings {
            let (sentence, link) = finding.rsplit_once("([").unwrap();
            let name = link.split_once(']').unwrap().0;
            let answer = published.split("\n## ").find(|section| section.starts_with(&format!("{name}\n"))).unwrap();
            let numbers =
                sentence.split(|c: char| !(c.is_ascii_digit() || c == '.')).map(|word| word.trim_matches('.'));
            let known = |number: &&str| number.contains('.') && !CONDITIONS.contains(number);
            for number in numbers.filter(known) {
                assert!(answer.contains(number), "{name} does not report {number}");
            }
        }
    }

    /// Numbers of the README that state a condition of an experiment, not a result.
    const CONDITIONS: [&str; 2] = ["0.1", "0.5"];
}
