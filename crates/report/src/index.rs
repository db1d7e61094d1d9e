//! The page with the findings of several runs.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_component::Ownership;

use crate::{
    content::{self, Authored},
    error::ReportError,
    print,
    run::Run,
    summary::RunSummary,
    write::{File, claim, write},
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

/// Replaces the sections of these reports in the page `README.md` of `folder`; all else stays. The result are the reports
/// without a section: they are not added, because a complete list alone gives the order.
///
/// A folder without the page stays without it, and a page in a folder that is not claimed stays as it is.
///
/// # Errors
/// [`ReportError`] when the page cannot be read or written.
pub fn update_index<'a>(
    findings: impl IntoIterator<Item = &'a str>,
    folder: &Path,
) -> Result<Vec<String>, ReportError> {
    let path = folder.join(NAME);
    if !path.exists() || !matches!(Ownership::of(folder, KIND)?, Ownership::Ours(_)) {
        return Ok(Vec::new());
    }
    let io = |source| ReportError::Io { doing: "read", path: path.clone(), source };
    let mut page = fs::read_to_string(&path).map_err(io)?;
    let mut without = Vec::new();
    for fresh in findings {
        match section_of(&page, fresh) {
            Some(section) => page.replace_range(section, fresh),
            None => without.push(fresh.trim_start().lines().next().unwrap_or_default().replace("## ", "")),
        }
    }
    write(folder, NAME, page.as_bytes())?;
    Ok(without)
}

/// The range of the section with the heading of `fresh`: from the empty line before it to its line of links.
fn section_of(page: &str, fresh: &str) -> Option<std::ops::Range<usize>> {
    let heading = format!("\n{}\n", fresh.trim_start().lines().next()?);
    let start = page.find(&heading)?;
    let links = start + page[start..].find("\n[Report](")? + 1;
    let end = links + page[links..].find('\n')? + 1;
    // The links of another section end this one.
    let other = page[start + heading.len()..].find("\n## ").is_some_and(|next| start + heading.len() + next < links);
    (!other).then_some(start..end)
}

/// Whether `README.md` in `folder` has exactly these findings and the version of the program.
pub fn index_holds<'a>(findings: impl IntoIterator<Item = &'a str>, folder: &Path) -> bool {
    fs::read(folder.join(NAME)).unwrap_or_default() == text(findings).as_bytes()
}

fn text<'a>(findings: impl IntoIterator<Item = &'a str>) -> String {
    let head = format!(
        "# What we found\n\nMade by seafix {}. The numbers of every sentence below a question are computed from logs. They appear in the linked report as well, \
         where each has a key with its log, topic and time range.\n",
        env!("CARGO_PKG_VERSION")
    );
    findings.into_iter().fold(head, |text, section| text + section)
}

/// The section of one run: question, main figure, answer, findings and links to its report.
#[derive(Debug)]
pub(crate) struct Section {
    question: String,
    figure: Option<&'static str>,
    answer: String,
    findings: Vec<String>,
    /// The linked files with their names.
    links: Vec<[&'static str; 2]>,
}

impl Section {
    /// The section of a run whose report has these files.
    pub(crate) fn of(run: &Run, summary: &RunSummary, authored: Option<&Authored>, files: &[File]) -> Self {
        let there = |file: &str| files.iter().any(|(name, _)| name == file || name.starts_with(&format!("{file}/")));
        let (answer, findings) = content::findings(run, summary, authored);
        let links =
            [["Report", "report.html"], ["PDF", "report.pdf"], ["tables", "tables"], ["summary", "summary.txt"]];
        Self {
            question: print::escape_markdown(&run.header().question),
            figure: MAIN.into_iter().find(|file| there(file)),
            answer: print::markdown(&answer),
            findings: findings.iter().map(|finding| print::markdown(finding)).collect(),
            links: links.into_iter().filter(|[_, file]| there(file)).collect(),
        }
    }

    /// The text of the section, with links to the report in `folder`.
    pub(crate) fn text(&self, folder: &Path) -> String {
        let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let escaped = print::escape_markdown(&name);
        let mut text = format!("\n## {escaped}\n\n*{}*\n\n", self.question);
        if let Some(figure) = self.figure {
            text += &format!("[![The main figure of {escaped}]({name}/{figure})]({name}/report.html)\n\n");
        }
        text += &format!("**Answer.** {}\n\n", self.answer);
        self.findings.iter().for_each(|finding| text += &format!("- {finding}\n"));
        let links: Vec<String> = self.links.iter().map(|[what, file]| format!("[{what}]({name}/{file})")).collect();
        text + &format!("\n{}\n", links.join(", "))
    }
}

/// The candidates for the main figure, in order of preference.
const MAIN: [&str; 5] = [
    "main.svg",
    "figures/error-over-noise.svg",
    "figures/sawtooth.svg",
    "figures/error-over-condition.svg",
    "figures/rates.svg",
];
