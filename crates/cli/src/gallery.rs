//! The gallery of the published reports: question, main figure and answer of each.

use std::path::Path;

use seafix_component::{Fault, read_text};

/// An entry of the index of reports.
struct Entry<'a> {
    name: &'a str,
    question: &'a str,
    answer: &'a str,
}

/// The entries of `reports/README.md`, in its order.
fn entries(index: &str) -> impl Iterator<Item = Entry<'_>> {
    index.split("\n## ").skip(1).filter_map(|section| {
        let name = section.lines().next()?;
        let question = section.lines().find_map(|line| line.strip_prefix('*')?.strip_suffix('*'))?;
        let answer = section.lines().find_map(|line| line.strip_prefix("**Answer.** "))?;
        Some(Entry { name, question, answer })
    })
}

/// The main figures of the reports in `folder`: the name of each in the gallery, and its content.
///
/// # Errors
/// An index or a figure that cannot be read.
pub(crate) fn figures(folder: &Path) -> Result<Vec<(String, String)>, Fault> {
    let index = read_text(&folder.join("README.md"))?;
    let with_one = entries(&index).filter(|entry| folder.join(entry.name).join("main.svg").exists());
    let figure =
        |entry: Entry<'_>| Ok((format!("{}.svg", entry.name), read_text(&folder.join(entry.name).join("main.svg"))?));
    with_one.map(figure).collect()
}

/// The page of the reports in `folder`.
///
/// # Errors
/// An index that cannot be read.
pub(crate) fn markdown(folder: &Path) -> Result<String, Fault> {
    let index = read_text(&folder.join("README.md"))?;
    let text = entries(&index).map(|Entry { name, question, answer }| {
        let figure = match folder.join(name).join("main.svg").exists() {
            true => format!("![The main figure of {name}](gallery/{name}.svg)\n\n"),
            false => String::new(),
        };
        format!("\n## {name}\n\n*{question}*\n\n{figure}{answer}\n\nThe report is `reports/{name}/report.html`.\n")
    });
    Ok(text.collect::<String>() + "\n")
}
