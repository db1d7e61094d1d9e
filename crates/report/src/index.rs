//! The page with the findings of several runs.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    content,
    error::ReportError,
    print,
    run::Run,
    summary::RunSummary,
    write::{claim, write},
};

/// The file name of the page.
const NAME: &str = "README.md";

/// The kind of the folder of several reports.
const KIND: &str = "reports";

/// Claims `folder` for the page of all reports, before anything is written into it.
///
/// # Errors
/// [`ReportError`] when the folder is not empty and has no marker, or cannot be written.
pub fn claim_index(folder: &Path) -> Result<(), ReportError> {
    claim(folder, KIND, NAME)
}

/// Writes the page `README.md` with the findings of all reports into `folder`.
///
/// It states the version of the program and lists the findings in the given order. The reports must be in subfolders of
/// `folder` already, which [`claim_index`] has claimed.
///
/// # Errors
/// [`ReportError`] when the folder is not claimed, or the file cannot be written.
pub fn index<'a>(findings: impl IntoIterator<Item = &'a str>, folder: &Path) -> Result<PathBuf, ReportError> {
    claim_index(folder)?;
    write(folder, NAME, text(findings).as_bytes())
}

/// Whether `README.md` in `folder` has exactly these findings and the version of the program.
pub fn index_holds<'a>(findings: impl IntoIterator<Item = &'a str>, folder: &Path) -> bool {
    fs::read(folder.join(NAME)).unwrap_or_default() == text(findings).as_bytes()
}

fn text<'a>(findings: impl IntoIterator<Item = &'a str>) -> String {
    let head = format!(
        "# What we found\n\nMade by seafix {}. Every sentence below a question is generated from logs and appears in the linked report as well, \
         where each number has a key with its log, topic and time range.\n",
        env!("CARGO_PKG_VERSION")
    );
    findings.into_iter().fold(head, |text, section| text + section)
}

/// The section of one run: question, main figure, answer, findings and links to the report in `folder`.
pub(crate) fn section(run: &Run, summary: &RunSummary, folder: &Path) -> String {
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let escaped = print::escape_markdown(&name);
    let there = |file: &str| folder.join(file).exists();
    let mut text = format!("\n## {escaped}\n\n*{}*\n\n", print::escape_markdown(&run.header().question));
    if let Some(figure) = MAIN.iter().find(|file| there(file)) {
        text += &format!("[![The main figure of {escaped}]({name}/{figure})]({name}/report.html)\n\n");
    }
    let (answer, findings) = content::findings(run, summary);
    text += &format!("**Answer.** {}\n\n", print::markdown(&answer));
    for finding in findings {
        text += &format!("- {}\n", print::markdown(&finding));
    }
    let links = [("Report", "report.html"), ("PDF", "report.pdf"), ("tables", "tables"), ("summary", "summary.txt")];
    let links = links.iter().filter(|(_, file)| there(file));
    let links: Vec<String> = links.map(|(what, file)| format!("[{what}]({name}/{file})")).collect();
    text + &format!("\n{}\n", links.join(", "))
}

/// The candidates for the main figure, in order of preference.
const MAIN: [&str; 5] = [
    "main.svg",
    "figures/error-over-noise.svg",
    "figures/sawtooth.svg",
    "figures/error-over-condition.svg",
    "figures/rates.svg",
];
