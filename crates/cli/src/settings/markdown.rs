//! The page `docs/settings.md`.

use seafix_component::{Form, Setting};

use super::{
    tables::{Section, section},
    text::inline,
};
use crate::catalogue::kinds;

/// The tables of the page, in the order of a file.
const TABLES: [&str; 5] = ["experiment", "pipeline", "acceptance", "navigation", "sites"];

/// The reference of all settings.
pub(crate) fn markdown() -> String {
    let mut text = String::new();
    for name in TABLES {
        let Some(Section { about, settings }) = section(name) else { continue };
        // A table with a part of its own is not repeated.
        let elsewhere: Vec<String> =
            TABLES.iter().filter(|other| **other != name).map(|name| format!("{name}.")).collect();
        let own = settings.iter().filter(|setting| !elsewhere.iter().any(|below| setting.key.starts_with(below)));
        text += &format!("## `{name}`\n\nThe settings of {}.\n\n{}\n", about.trim_end_matches('.'), table(own));
    }
    for kind in kinds() {
        text += &format!("## {}\n\n", capital(&kind.plural));
        for listing in kind.listings {
            text += &format!("### {} `{}`\n\n{}.\n\n", listing.kind, listing.name, capital(listing.summary));
            let settings = listing.table.settings();
            text += &if settings.is_empty() { "No settings.\n".to_owned() } else { table(settings.iter()) };
            text += "\n";
        }
    }
    text.trim_end().to_owned() + "\n"
}

fn table<'a>(settings: impl Iterator<Item = &'a Setting>) -> String {
    let head = "| setting | meaning | unit | range | default |\n|---|---|---|---|---|\n";
    head.to_owned() + &settings.map(row).collect::<String>()
}

fn row(setting: &Setting) -> String {
    let words = match &setting.form {
        Form::Words(words) => words.iter().map(|(word, meaning)| format!(" `{word}`: {meaning}")).collect(),
        _ => String::new(),
    };
    let unit = match setting.unit {
        Some("1") | None => "",
        Some(unit) => unit,
    };
    let default = match &setting.default {
        Some(_) if matches!(setting.form, Form::Table(_)) => String::new(),
        Some(value) => format!("`{}`", inline(value)),
        None => String::new(),
    };
    let cells =
        [&format!("`{}`", setting.key), &format!("{}{words}", setting.doc), unit, &setting.range.words, &default];
    let cells = cells.map(|cell| cell.replace('|', "\\|"));
    format!("| {} |\n", cells.join(" | "))
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
