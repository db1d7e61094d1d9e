//! `seafix report`.

use std::path::{Path, PathBuf};

use clap::Args;
use seafix_experiment::changed_outputs;
use seafix_report::{Forms, ReportError, Verified, index, report, verify};

use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, INPUT, OUTPUT, USAGE},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// The folders of the runs, a report each.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Where the report goes, or a folder below it for each of several runs [default: report/ in the run's folder].
    #[arg(long)]
    out: Option<PathBuf>,
    /// The page [default: all forms].
    #[arg(long)]
    html: bool,
    /// The LaTeX source.
    #[arg(long)]
    latex: bool,
    /// The PDF.
    #[arg(long)]
    pdf: bool,
    /// Write nothing: compute every printed number again from the logs, and say what of the report and the run differs.
    #[arg(long, conflicts_with_all = ["html", "latex", "pdf", "index"])]
    verify: bool,
    /// Also write README.md into the folder of all reports: what the runs found.
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
        let mut findings = Vec::new();
        for (run, folder) in self.runs.iter().zip(&folders) {
            let written = report(run, folder, forms).map_err(failure)?;
            print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))?;
            findings.push(written.findings);
        }
        if let (true, Some(out)) = (self.index, &self.out) {
            let page = index(findings.iter().map(String::as_str), out).map_err(failure)?;
            print(&format!("findings: {}\n", page.display()))?;
        }
        Ok(DONE)
    }

    /// Where each report goes.
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
                    "two runs would write their report to {}; give them folders of different names",
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
            if !verified(run, folder)?.0 {
                code = FINDINGS;
            }
        }
        Ok(code)
    }
}

/// Verifies a report and the files of its run, and says what was found; whether all is as it was written, and what the run
/// adds to the page of all reports.
pub(crate) fn verified(run: &Path, folder: &Path) -> Result<(bool, String), Failure> {
    let verified = verify(run, folder).map_err(failure)?;
    let changed = changed_outputs(run).map_err(|fault| Failure::faults(INPUT, &[fault]))?;
    let full = changed.is_empty();
    let mut changed: String = changed.iter().map(|fault| format!("{fault}\n")).collect();
    if !run.join("manifest.json").exists() {
        changed += &format!("note: {} has no manifest: its logs were read, its tables not looked at\n", run.display());
    }
    print(&format!("{changed}{}", said(&verified, &folder.display().to_string())))?;
    Ok((verified.holds() && full, verified.findings))
}

/// What a verification found, for people.
fn said(verified: &Verified, folder: &str) -> String {
    let mut text = String::new();
    for wrong in &verified.mismatches {
        text += &format!("{}: printed {}, logged {}: {}\n", wrong.file, wrong.printed, wrong.logged, wrong.key);
    }
    let Verified { missing, changed, strays, .. } = verified;
    let unlike =
        [(missing, "is missing"), (changed, "is not what the logs make"), (strays, "is none of this report's")];
    for (files, what) in unlike {
        files.iter().for_each(|file| text += &format!("{file} {what}\n"));
    }
    let text: String = text.chars().map(|c| if c.is_control() && c != '\n' { ' ' } else { c }).collect();
    let equal = verified.numbers - verified.mismatches.len();
    let alike = verified.files - missing.len() - changed.len();
    let more = if strays.is_empty() { String::new() } else { format!(", {} that are none of its", strays.len()) };
    format!(
        "{text}{folder}: {equal} of {} numbers equal to the last digit, {alike} of {} files as the logs make them{more}\n",
        verified.numbers, verified.files
    )
}

/// Logs that cannot be read are input, a report that cannot be written is output.
pub(crate) fn failure(error: ReportError) -> Failure {
    let output = matches!(error, ReportError::Io { doing: "write", .. } | ReportError::Foreign { .. });
    let code = if output { OUTPUT } else { INPUT };
    Failure::new(code, error)
}
