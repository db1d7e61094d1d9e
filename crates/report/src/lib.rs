//! Reports made from logs alone.
//!
//! [`summary`] gives the results of a run as a table for the terminal. [`report`] writes them as a paper: one
//! self-contained HTML page without scripts, LaTeX source, a PDF, figures as SVG and PDF, every plotted number as CSV
//! and JSON, and an entry for a bibliography. All read nothing but the `*.mcap` of the run, and give the same bytes for
//! the same logs. Every number carries a key that says where it comes from; [`verify`] computes each again.
//!
//! What a report says (`content`) is data (`document`), which printers (`print`) know nothing about.

mod compare;
mod content;
mod disparity;
mod document;
mod error;
mod field;
mod figure;
mod fix_intervals;
mod format;
mod index;
mod lever;
mod navigation_quantity;
mod number;
mod paired;
mod paper;
mod place;
mod points_of_interest;
mod print;
mod proportion;
mod run;
mod summary;
mod terminal;
mod verify;
mod write;

pub use compare::{Compared, compare};
pub use error::ReportError;
pub use index::{index, index_holds};
pub use paper::PAPER_FIT_RMS;
pub use summary::{Distribution, Limits, Row, RunSummary, StageTimeSummary};
pub use verify::{Mismatch, Verified, verify};
pub use write::{Forms, Report, report};

use std::path::Path;

use field::Field;
use number::{Key, Number};
use run::Run;

/// Reads the logs in `run_dir` and gives the results, a row a trial.
///
/// # Errors
/// [`ReportError`] when there is no log, or one cannot be read.
pub fn summary(run_dir: &Path) -> Result<RunSummary, ReportError> {
    Ok(RunSummary::of(&Run::read(run_dir)?))
}
