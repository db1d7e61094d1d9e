//! `seafix report`.

use std::path::PathBuf;

use clap::Args;
use seafix_report::{ReportError, report};

use crate::{
    exit::{DONE, Ended, Failure, INPUT, OUTPUT},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// The folder of the run.
    run: PathBuf,
    /// Where the report goes [default: report/ in the run's folder].
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Report {
    pub(crate) fn execute(&self) -> Ended {
        let folder = self.out.clone().unwrap_or_else(|| self.run.join("report"));
        let written = report(&self.run, &folder).map_err(failure)?;
        print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))?;
        Ok(DONE)
    }
}

/// Logs that cannot be read are input, a report that cannot be written is output.
pub(crate) fn failure(error: ReportError) -> Failure {
    let code = if matches!(error, ReportError::Io { doing: "write", .. }) { OUTPUT } else { INPUT };
    Failure::new(code, error)
}
