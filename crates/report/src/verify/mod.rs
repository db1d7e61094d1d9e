//! Verification of reports: every printed number is computed again from the logs.

mod counts;
mod evaluate;
mod logs;
mod rows;
mod written;

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    answer::Answer,
    error::ReportError,
    forms::Forms,
    index::Section,
    number::{Key, Number},
    print::{ANSWER, CLAIM, FORMS},
    run::Run,
    summary::RunSummary,
    write::{authored, files, strangers},
};
use evaluate::evaluate;
use logs::Logs;

/// The result of a verification.
#[derive(Debug, Default)]
pub struct Verified {
    /// The number of printed numbers that were computed again.
    pub numbers: usize,
    /// The printed numbers that differ from the logs.
    pub mismatches: Vec<Mismatch>,
    /// The number of files that the logs generate.
    pub files: usize,
    /// The generated files that are missing in the folder.
    pub missing: Vec<String>,
    /// The generated files whose content differs from that in the folder.
    pub changed: Vec<String>,
    /// The files in the folder that the logs do not generate.
    pub strays: Vec<String>,
    /// One line for each claim of the written answer that does not hold in the logs.
    pub unmet: Vec<String>,
    /// The report's section of the page that [`index`](crate::index) writes, generated from the logs.
    pub findings: String,
}

/// A printed number that differs from the logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mismatch {
    /// The file with the number.
    pub file: String,
    /// The key of the number: quantity, topic, stamps, logs.
    pub key: String,
    /// The printed text.
    pub printed: String,
    /// The text according to the logs, or the reason why there is none.
    pub logged: String,
}

impl Verified {
    /// Whether the report agrees with the logs in every number, file and claim.
    pub fn holds(&self) -> bool {
        let full = self.missing.is_empty() && self.changed.is_empty() && self.strays.is_empty();
        full && self.mismatches.is_empty() && self.unmet.is_empty()
    }
}

/// Verifies the report in `folder` against the logs in `run_dir`.
///
/// Every printed number is computed again from its key and compared to the last printed digit. Every file is generated
/// again and compared byte by byte, with the written answer that the page records. The code that evaluates keys is
/// independent of the code that writes reports.
///
/// # Errors
/// [`ReportError`] when the folder has no report, or a log cannot be read.
pub fn verify(run_dir: &Path, folder: &Path) -> Result<Verified, ReportError> {
    let page = String::from_utf8_lossy(&read(folder, PAGE)?).into_owned();
    // A record that was changed into no answer gives another page, which is then reported as changed.
    let answer = recorded(&page, ANSWER).first().and_then(|text| Answer::parse(text, &recorded(&page, CLAIM)).ok());
    verify_answered(run_dir, folder, answer.as_ref())
}

/// Verifies the report in `folder` as [`verify`] does, as one with this written answer or with a generated one.
///
/// # Errors
/// [`ReportError`] when the folder has no report, a log cannot be read, or the answer has no value in this run.
pub fn verify_answered(run_dir: &Path, folder: &Path, answer: Option<&Answer>) -> Result<Verified, ReportError> {
    let mut verified = Verified::default();
    let mut logs = Logs::new(run_dir);
    let page = String::from_utf8_lossy(&read(folder, PAGE)?).into_owned();
    for (key, printed) in of_page(&page) {
        verified.check(PAGE, &key, &printed, &mut logs)?;
    }
    // The caller lists changed logs.
    let run = Run::read_as_it_is(run_dir)?;
    let summary = RunSummary::of(&run);
    let authored = authored(&run, &summary, answer)?;
    let made = files(&run, &summary, forms(&page), authored.as_ref())?;
    verified.files = made.len();
    verified.findings = Section::of(&run, &summary, authored.as_ref(), &made).text(folder);
    verified.unmet = authored.map(|authored| authored.unmet()).unwrap_or_default();
    let name_of = |path: PathBuf| path.strip_prefix(folder).unwrap_or(&path).display().to_string();
    verified.strays = strangers(folder, &made).into_iter().map(name_of).collect();
    for (name, bytes) in made {
        let Ok(there) = read(folder, &name) else {
            verified.missing.push(name);
            continue;
        };
        if name.ends_with(".json") {
            for (key, printed) in of_table(&there) {
                verified.check(&name, &key, &printed, &mut logs)?;
            }
        }
        if there != bytes {
            verified.changed.push(name);
        }
    }
    Ok(verified)
}

impl Verified {
    fn check(&mut self, file: &str, key: &str, printed: &str, logs: &mut Logs) -> Result<(), ReportError> {
        self.numbers += 1;
        let logged = match Key::parse(key) {
            Some(parsed) => match evaluate(&parsed, logs)? {
                Ok(value) => again(&parsed, value, printed),
                Err(why) => why,
            },
            None => "cannot parse its key".to_owned(),
        };
        if logged != printed {
            let mismatch = Mismatch { file: file.to_owned(), key: key.to_owned(), printed: printed.to_owned(), logged };
            self.mismatches.push(mismatch);
        }
        Ok(())
    }
}

/// The file with the printed numbers.
const PAGE: &str = "report.html";

fn read(folder: &Path, name: &str) -> Result<Vec<u8>, ReportError> {
    let path = folder.join(name);
    fs::read(&path).map_err(|source| ReportError::Io { doing: "read", path, source })
}

/// The forms that a page records; all forms without a record.
fn forms(page: &str) -> Forms {
    recorded(page, FORMS).first().map_or(Forms::ALL, |words| Forms::of_words(words))
}

/// The contents of the meta elements of this name.
fn recorded(page: &str, name: &str) -> Vec<String> {
    let begin = format!("<meta name=\"{name}\" content=\"");
    page.split(&begin).skip(1).filter_map(|rest| rest.split_once('"')).map(|(text, _)| unescape(text)).collect()
}

/// A value in the printed format of `printed`.
fn again(key: &Key, value: Option<f64>, printed: &str) -> String {
    if key.what == "stamp" {
        return key.span[0].to_string();
    }
    Number::like(printed, value)
}

/// The keys and texts of all numbers of a page.
fn of_page(page: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for part in page.split("<data ").skip(1) {
        let title = part.split_once("title=\"").and_then(|(_, rest)| rest.split_once('"'));
        let Some((key, rest)) = title else { continue };
        let text = rest.split_once('>').and_then(|(_, rest)| rest.split_once("</data>"));
        found.extend(text.map(|(text, _)| (unescape(key), unescape(text))));
    }
    found
}

fn unescape(text: &str) -> String {
    let signs = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")];
    signs.iter().fold(text.to_owned(), |text, (written, sign)| text.replace(written, sign))
}

/// The keys and texts of all numbers of a JSON table.
fn of_table(bytes: &[u8]) -> Vec<(String, String)> {
    let Ok(table) = serde_json::from_slice::<serde_json::Value>(bytes) else { return Vec::new() };
    let rows = table["rows"].as_array().cloned().unwrap_or_default();
    let cells = rows.iter().filter_map(|row| row.as_array()).flatten();
    cells.filter_map(|cell| Some((cell["key"].as_str()?.to_owned(), cell["text"].as_str()?.to_owned()))).collect()
}
