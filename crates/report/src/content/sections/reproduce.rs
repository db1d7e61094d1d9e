//! The sections on reproduction and on the configuration.

use crate::{
    document::{Block, Section, code, text},
    run::Run,
};

pub(crate) fn section(run: &Run) -> Section {
    let header = run.header();
    let command =
        if header.command.is_empty() { "seafix run CONFIGURATION".to_owned() } else { header.command.clone() };
    Section::new("How to reproduce").with([
        Block::Listing { title: String::new(), text: command, folded: false },
        Block::Paragraph(text![
            "Every number of this report is computed from the logs alone and has a key: statistic and quantity, topic, first and last stamp, log. ",
            code("seafix report --verify"),
            " reads the keys from the printed page and computes each number again. The same version and seeds give the same results except times, on every machine and with any number of threads."
        ]),
    ])
}

pub(crate) fn configuration(run: &Run) -> Section {
    let header = run.header();
    let mut section = Section::new("Configuration");
    section.say(text![
        "The resolved configuration of each trial with all defaults; later trials show only the lines that differ from the first."
    ]);
    let first: Vec<&str> = header.configuration.trim_end().lines().collect();
    for (index, trial) in run.trials.iter().enumerate() {
        let own = trial.header.configuration.trim_end();
        let text = if index == 0 { own.to_owned() } else { differing(&first, own) };
        section.add(Block::Listing { title: trial.file(), text, folded: true });
    }
    if !header.site.is_empty() {
        let text = header.site.trim_end().to_owned();
        section.add(Block::Listing { title: "Site".to_owned(), text, folded: true });
    }
    section
}

/// The lines of `own` that are missing from `first`, each under the head of its TOML table.
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
    if text.is_empty() { "same as the first trial".to_owned() } else { text }
}
