//! Reports made from logs alone.
//!
//! [`summary`] gives the results of a run as a table for the terminal, [`report`] writes them as a paper:
//! one self-contained HTML page without scripts. Both read nothing but the `*.mcap` of the run, and give
//! the same bytes for the same logs.

mod disparity;
mod error;
mod figure;
mod format;
mod page;
mod paper;
mod run;
mod summary;
mod terminal;

use std::{
    fs,
    path::{Path, PathBuf},
};

pub use error::ReportError;
pub use paper::PAPER_M1;
pub use summary::{Limits, Row, Spread, StageTimes, Summary};

use run::Run;

/// A report that was written.
#[derive(Debug)]
pub struct Report {
    /// The page.
    pub page: PathBuf,
    /// The results in it, as a table for the terminal.
    pub summary: Summary,
}

/// Reads the logs in `run_dir` and gives the results, a row a trial.
///
/// # Errors
/// [`ReportError`] when there is no log, or one cannot be read.
pub fn summary(run_dir: &Path) -> Result<Summary, ReportError> {
    Ok(Summary::of(&Run::read(run_dir)?))
}

/// Reads the logs in `run_dir` and writes into `folder`: `report.html`, the picture in it as `fix.jpg`,
/// and the table for the terminal as `summary.txt`.
///
/// # Errors
/// [`ReportError`] when there is no log, one cannot be read, or the report cannot be written.
pub fn report(run_dir: &Path, folder: &Path) -> Result<Report, ReportError> {
    let run = Run::read(run_dir)?;
    let summary = Summary::of(&run);
    let picture = figure::Picture::choose(&run)?;
    let page = page::page(&run, &summary, picture.as_ref()).into_string();

    if let Some(picture) = &picture {
        write(folder, "fix.jpg", &picture.jpeg)?;
    }
    write(folder, "summary.txt", summary.to_string().as_bytes())?;
    Ok(Report { page: write(folder, "report.html", page.as_bytes())?, summary })
}

/// Writes a file whole or not at all.
fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
    let (path, partial) = (folder.join(name), folder.join(format!("{name}.partial")));
    let io = |source| ReportError::Io { doing: "write", path: path.clone(), source };
    fs::create_dir_all(folder).map_err(io)?;
    fs::write(&partial, bytes).map_err(io)?;
    fs::rename(&partial, &path).map_err(io)?;
    Ok(path)
}
