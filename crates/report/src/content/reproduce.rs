//! How to get the same again.

use crate::{
    document::{Block, Section, code, text},
    run::Run,
};

pub(super) fn section(run: &Run) -> Section {
    let header = run.header();
    let command =
        if header.command.is_empty() { "seafix run CONFIGURATION".to_owned() } else { header.command.clone() };
    Section::new("How to reproduce").with([
        Block::Listing { title: String::new(), text: command, folded: false },
        Block::Paragraph(text![
            "Every number of this report is computed from the logs alone and carries a key: what it is, the topic, the first and last stamp, the log. ",
            code("seafix report --verify"),
            " reads the keys out of the printed page and computes each number again. With the same version and seeds everything but the times comes out the same, on any machine and any number of threads."
        ]),
    ])
}

pub(super) fn configuration(run: &Run) -> Section {
    let header = run.header();
    let mut section = Section::new("Configuration");
    section.say(text![
        "Each trial with every default written out; what it has in common with the first is left out of the others."
    ]);
    let first: Vec<&str> = header.configuration.trim_end().lines().collect();
    for (index, trial) in run.trials.iter().enumerate() {
        let own = trial.header.configuration.trim_end();
        let text = if index == 0 { own.to_owned() } else { differing(&first, own) };
        section.add(Block::Listing { title: trial.file(), text, folded: true });
    }
    if !header.site.is_empty() {
        let text = header.site.trim_end().to_owned();
        section.add(Block::Listing { title: "The site".to_owned(), text, folded: true });
    }
    section
}

/// The lines of `own` that are not those of `first`, each under its table.
fn differing(first: &[&str], own: &str) -> String {
    let placed = |lines: &mut dyn Iterator<Item = &str>| -> Vec<(String, String)> {
        let mut table = String::new();
        lines
            .map(|line| {
                if line.starts_with('[') {
                    table = line.to_owned();
                }
                (table.clone(), line.to_owned())
            })
            .collect()
    };
    let known = placed(&mut first.iter().copied());
    let mut text = String::new();
    let mut shown = String::new();
    for (table, line) in placed(&mut own.lines()).into_iter().filter(|line| !known.contains(line) && !line.1.is_empty())
    {
        if table != shown && line != table {
            text += &format!("{table}\n");
            shown = table;
        }
        text += &format!("{line}\n");
    }
    if text.is_empty() { "the same".to_owned() } else { text }
}
