//! Reports on experiments, generated from their logs alone.
//!
//! [`summary`] gives the results of a run as a table for the terminal. [`report`] writes a paper: one self-contained
//! HTML page without scripts, LaTeX source, a PDF, figures as SVG and PDF, every plotted number as CSV and JSON, and a
//! BibTeX entry. Both read only the `*.mcap` files of the run and give the same bytes for the same logs. Every number
//! has a key that identifies its source in the logs; [`verify`] computes each number again from its key.
//!
//! The content of a report (module `content`) is a data structure (`document`) that printers (`print`) render.
//!
//! ```no_run
//! # fn main() -> Result<(), seafix_report::ReportError> {
//! let run = std::path::Path::new("runs/virtual-direct"); // written by `seafix run`
//! let summary = seafix_report::summary(run)?;
//! for row in &summary.rows {
//!     println!("{}: {} fixes of {} attempts, {} wrong", row.trial, row.found + row.wrong, row.attempted, row.wrong);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A folder without logs is an error with its path:
//!
//! ```
//! let error = seafix_report::summary("no-such-run".as_ref()).unwrap_err();
//! assert!(error.to_string().contains("no-such-run"));
//! ```

mod answer;
mod compare;
mod content;
mod disparity;
mod document;
mod error;
mod field;
mod figure;
mod fix_intervals;
mod fonts;
mod format;
mod forms;
mod index;
mod lever;
mod navigation_quantity;
mod number;
mod origin;
mod paired;
mod place;
mod points_of_interest;
mod print;
mod proportion;
mod published;
mod rejections;
mod rms;
mod run;
mod scale_error;
mod summary;
mod terminal;
mod verify;
mod write;

pub use answer::{Answer, AnswerError};
pub use compare::{Compared, compare};
pub use error::ReportError;
pub use forms::Forms;
pub use index::{claim_index, index, index_holds, update_index};
pub use summary::{Distribution, Limits, Row, RunSummary, StageTimeSummary};
pub use verify::{Mismatch, Verified, verify, verify_answered};
pub use write::{Prepared, Report, prepare, report};

use std::path::Path;

use run::Run;

/// Summarises the logs in `run_dir`, one row for every trial.
///
/// # Errors
/// [`ReportError`] when the folder has no log, or a log cannot be read.
pub fn summary(run_dir: &Path) -> Result<RunSummary, ReportError> {
    Ok(RunSummary::of(&Run::read(run_dir)?))
}
