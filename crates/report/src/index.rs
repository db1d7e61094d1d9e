//! What several runs found, on one page.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{ReportError, Summary, content, print, run::Run, write::write};

/// The name of the page.
const NAME: &str = "README.md";

/// Writes `README.md` into `folder`: what the runs found, each with its question, its main figure and its numbers. Their
/// reports are there already, in folders of the runs' names.
///
/// # Errors
/// [`ReportError`] when a log cannot be read, or the file cannot be written.
pub fn index(runs: &[PathBuf], folder: &Path) -> Result<PathBuf, ReportError> {
    write(folder, NAME, text(runs, folder)?.as_bytes())
}

/// Whether `README.md` in `folder` says what the logs of the runs say.
///
/// # Errors
/// [`ReportError`] when a log cannot be read.
pub fn index_holds(runs: &[PathBuf], folder: &Path) -> Result<bool, ReportError> {
    let there = fs::read(folder.join(NAME)).unwrap_or_default();
    Ok(there == text(runs, folder)?.as_bytes())
}

fn text(runs: &[PathBuf], folder: &Path) -> Result<String, ReportError> {
    let mut text = String::from(
        "# What we found\n\nEvery sentence below its question is made from logs, and stands in the report beside it as well, where each number \
         carries the log, the topic and the time range that it comes from.\n",
    );
    for path in runs {
        let run = Run::read(path)?;
        let summary = Summary::of(&run);
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let escaped = print::escape_markdown(&name);
        let there = |file: &str| folder.join(&name).join(file).exists();
        text += &format!("\n## {escaped}\n\n*{}*\n\n", print::escape_markdown(&run.header().question));
        if let Some(figure) = MAIN.iter().find(|file| there(file)) {
            text += &format!("[![The main figure of {escaped}]({name}/{figure})]({name}/report.html)\n\n");
        }
        for finding in content::findings(&run, &summary) {
            text += &format!("- {}\n", print::markdown(&finding));
        }
        let links = [
            ("Report", "report.html"),
            ("PDF", "report.pdf"),
            ("tables", "tables"),
            ("table of the terminal", "summary.txt"),
        ];
        let links = links.iter().filter(|(_, file)| there(file));
        let links: Vec<String> = links.map(|(what, file)| format!("[{what}]({name}/{file})")).collect();
        text += &format!("\n{}\n", links.join(", "));
    }
    Ok(text)
}

/// What a report may show first.
const MAIN: [&str; 5] = [
    "main.svg",
    "figures/error-over-noise.svg",
    "figures/sawtooth.svg",
    "figures/error-over-condition.svg",
    "figures/rates.svg",
];
