//! `seafix report`.

use std::path::{Path, PathBuf};

use clap::Args;
use seafix_experiment::changed_outputs;
use seafix_report::{Answer, Forms, ReportError, Verified, claim_index, index, prepare, verify};

use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, INPUT, OUTPUT, USAGE},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// The folders of the runs; each gets a report.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// The folder of the report; with several runs, of one subfolder for each [default: report/ in the run's folder].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Write the page [default: all forms].
    #[arg(long)]
    html: bool,
    /// Write the LaTeX source.
    #[arg(long)]
    latex: bool,
    /// Write the PDF.
    #[arg(long)]
    pdf: bool,
    /// Write nothing: compute every printed number again from the logs, and list differences of report and run.
    #[arg(long, conflicts_with_all = ["html", "latex", "pdf", "index"])]
    verify: bool,
    /// The answer to the question: words, and queries in braces whose values are computed from the logs, such as
    /// `{fix-rate: method=the defaults}` [default: a generated answer].
    #[arg(long, value_name = "TEXT", conflicts_with = "verify")]
    answer: Option<String>,
    /// A relation that the words of the answer assert, such as `fix-rate: method=a > fix-rate: method=b`; repeatable. The
    /// report is not written if it does not hold (exit code 1).
    #[arg(long, value_name = "CLAIM", requires = "answer")]
    claim: Vec<String>,
    /// Also write README.md with the findings of all runs into the folder of the reports.
    #[arg(long, requires = "out")]
    index: bool,
}

impl Report {
    pub(crate) fn execute(&self) -> Ended {
        let folders = self.folders()?;
        if self.verify {
            return self.verify_all(&folders);
        }
        let forms = match (self.html, self.latex, self.pdf) {
            (false, false, false) => Forms::ALL,
            (html, latex, pdf) => Forms { html, latex, pdf, small: false },
        };
        let answer = self.answer()?;
        if let (true, Some(out)) = (self.index, &self.out) {
            claim_index(out).map_err(failure)?;
        }
        let mut findings = Vec::new();
        for (run, folder) in self.runs.iter().zip(&folders) {
            let prepared = prepare(run, forms, answer.as_ref()).map_err(failure)?;
            if !prepared.unmet.is_empty() {
                let unmet = prepared.unmet.iter().map(|line| format!("{}: {line}\n", run.display()));
                print(&unmet.collect::<String>())?;
                return Ok(FINDINGS);
            }
            let written = prepared.write(folder).map_err(failure)?;
            print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))?;
            findings.push(written.findings);
        }
        if let (true, Some(out)) = (self.index, &self.out) {
            let page = index(findings.iter().map(String::as_str), out).map_err(failure)?;
            print(&format!("findings: {}\n", page.display()))?;
        }
        Ok(DONE)
    }

    /// The written answer; it is about one run.
    fn answer(&self) -> Result<Option<Answer>, Failure> {
        let Some(text) = &self.answer else { return Ok(None) };
        if self.runs.len() > 1 {
            let line = format!("cannot give {} runs one answer; report each run alone", self.runs.len());
            return Err(Failure::new(USAGE, line));
        }
        let parsed = Answer::parse(text, &self.claim);
        parsed.map(Some).map_err(|error| Failure::new(USAGE, format!("cannot read the answer: {error}")))
    }

    /// The folder of each report.
    fn folders(&self) -> Result<Vec<PathBuf>, Failure> {
        let several = self.runs.len() > 1 || self.index;
        let folder = |run: &PathBuf| match &self.out {
            None => run.join("report"),
            Some(out) if several => out.join(run.file_name().unwrap_or_default()),
            Some(out) => out.clone(),
        };
        let folders: Vec<PathBuf> = self.runs.iter().map(folder).collect();
        for (index, one) in folders.iter().enumerate() {
            if folders[..index].contains(one) {
                let line = format!(
                    "cannot write two reports into {}; give the folders of the runs different names",
                    one.display()
                );
                return Err(Failure::new(USAGE, line));
            }
        }
        Ok(folders)
    }

    fn verify_all(&self, folders: &[PathBuf]) -> Ended {
        let mut code = DONE;
        for (run, folder) in self.runs.iter().zip(folders) {
            if !verified(run, folder, verify)?.0 {
                code = FINDINGS;
            }
        }
        Ok(code)
    }
}

/// Verifies a report and the files of its run and prints the result. Returns whether everything is unchanged, and the
/// run's section of the page of all reports.
pub(crate) fn verified(
    run: &Path,
    folder: &Path,
    verify: impl Fn(&Path, &Path) -> Result<Verified, ReportError>,
) -> Result<(bool, String), Failure> {
    let verified = verify(run, folder).map_err(failure)?;
    let changed = changed_outputs(run).map_err(|fault| Failure::faults(INPUT, &[fault]))?;
    let full = changed.is_empty();
    let mut changed: String = changed.iter().map(|fault| format!("{fault}\n")).collect();
    if !run.join("manifest.json").exists() {
        changed += &format!("note: {} has no manifest; its logs were verified, its tables were not\n", run.display());
    }
    print(&format!("{changed}{}", message(&verified, &folder.display().to_string())))?;
    Ok((verified.holds() && full, verified.findings))
}

/// The result of a verification as text.
fn message(verified: &Verified, folder: &str) -> String {
    let mut text = String::new();
    for wrong in &verified.mismatches {
        text += &format!("{}: printed {}, logged {}: {}\n", wrong.file, wrong.printed, wrong.logged, wrong.key);
    }
    verified.unmet.iter().for_each(|line| text += &format!("{folder}: {line}\n"));
    let Verified { missing, changed, strays, .. } = verified;
    let unlike =
        [(missing, "is missing"), (changed, "differs from the logs"), (strays, "does not belong to this report")];
    for (files, what) in unlike {
        files.iter().for_each(|file| text += &format!("{file} {what}\n"));
    }
    let text: String = text.chars().map(|c| if c.is_control() && c != '\n' { ' ' } else { c }).collect();
    let equal = verified.numbers - verified.mismatches.len();
    let alike = verified.files - missing.len() - changed.len();
    let more = if strays.is_empty() { String::new() } else { format!(", {} that do not belong to it", strays.len()) };
    format!(
        "{text}{folder}: {equal} of {} numbers equal to the last digit, {alike} of {} files equal to those made from the logs{more}\n",
        verified.numbers, verified.files
    )
}

/// The failure of an error: an unreadable log is a failure of input, an answer without a value one of usage, an unwritable
/// report one of output.
pub(crate) fn failure(error: ReportError) -> Failure {
    let output =
        matches!(error, ReportError::Io { doing: "write", .. } | ReportError::Foreign { .. } | ReportError::Folder(_));
    let code = match error {
        _ if output => OUTPUT,
        ReportError::Answer { .. } => USAGE,
        _ => INPUT,
    };
    Failure::new(code, error)
}
