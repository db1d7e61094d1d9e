//! The errors of reports.

use std::path::PathBuf;

use seafix_component::Fault;
use seafix_log::LogError;

use crate::answer::AnswerError;

/// The reason why a report, a summary or a comparison cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder has no log.
    #[error("cannot report {}: no *.mcap file; {}", .0.display(), if .0.join("manifest.json").exists() { "its run has not ended: resume it with `seafix run --resume`, or save its finished part with `seafix recover`" } else { "give the folder of a run" })]
    NoLogs(PathBuf),
    /// The manifest has a later format.
    #[error("cannot report the run of {}: format {found}, but this version reads {known}; use the version that wrote the run", .path.display())]
    Newer {
        /// The manifest.
        path: PathBuf,
        /// The format of the manifest.
        found: String,
        /// The format that this version reads.
        known: &'static str,
    },
    /// The output folder has other files and no report.
    #[error("cannot write a report to {}: it holds `{other}`, which no report here has written; choose a new folder, or move it away", .folder.display())]
    Foreign {
        /// The output folder.
        folder: PathBuf,
        /// The name of the first file or folder in it.
        other: String,
    },
    /// An output folder that cannot be used.
    #[error(transparent)]
    Folder(#[from] Fault),
    /// A log of a finished run is missing.
    #[error("cannot report the run of {}: its log {log} is missing, and the report would lack a trial; restore the log, or run the experiment again", .path.display())]
    Gone {
        /// The manifest.
        path: PathBuf,
        /// The name of the missing log.
        log: String,
    },
    /// The logs belong to different experiments.
    #[error("cannot report {} together with {}: they vary different keys; keep the logs of each run in its own folder", .other.display(), .first.display())]
    Mixed {
        /// The first log.
        first: PathBuf,
        /// The first log with other axes.
        other: PathBuf,
    },
    /// A written answer has no value in this run.
    #[error("cannot answer in the report on {run}: {error}")]
    Answer {
        /// The name of the run.
        run: String,
        /// The fault of the answer.
        error: AnswerError,
    },
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A file or folder cannot be read or written.
    #[error("cannot {doing} {}: {source}; check {} and the permissions", .path.display(),
        if *doing == "read" { "the name" } else { "the free space" })]
    Io {
        /// `read` or `write`.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The runs have different data.
    #[error("cannot compare {} and {}: {}; choose runs of the same data, or add --force", .first.display(), .other.display(), .differences.join(", "))]
    Incomparable {
        /// The first run.
        first: PathBuf,
        /// The first run with other data.
        other: PathBuf,
        /// The differences, one line each.
        differences: Vec<String>,
    },
}
