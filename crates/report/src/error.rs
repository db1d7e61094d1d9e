//! What can go wrong with a report.

use std::path::PathBuf;

use seafix_log::LogError;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder holds no log.
    #[error("{} holds no *.mcap: {}", .0.display(), if .0.join("manifest.json").exists() { "its run has not ended; `seafix run --resume` goes on with it, `seafix recover` saves what is there" } else { "it is not the folder of a run" })]
    NoLogs(PathBuf),
    /// A run of a later program.
    #[error("{}: a manifest of format {found}, this program knows {known}; report the run with the program that made it", .path.display())]
    Newer {
        /// The manifest.
        path: PathBuf,
        /// What it says it is.
        found: String,
        /// What is known.
        known: &'static str,
    },
    /// The folder is somebody else's.
    #[error("{} holds `{other}` and no report: nothing was written; name a new folder, or remove what is there", .folder.display())]
    Foreign {
        /// The folder.
        folder: PathBuf,
        /// The first thing in it.
        other: String,
    },
    /// A log of a finished run is gone.
    #[error("{} names the log {log}, which is not there: a report would leave its trial out without a word; put it back, or run the experiment again", .path.display())]
    Gone {
        /// The manifest.
        path: PathBuf,
        /// The log.
        log: String,
    },
    /// Logs of different experiments.
    #[error("{} varies other keys than {}: they belong to different runs; keep them in folders of their own", .other.display(), .first.display())]
    Mixed {
        /// The first log.
        first: PathBuf,
        /// One that differs.
        other: PathBuf,
    },
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The file system refused.
    #[error("cannot {doing} {}: {source}; is {}, and may this user {doing} there?", .path.display(),
        if *doing == "read" { "the name right" } else { "there room" })]
    Io {
        /// `read` or `write`.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Runs that say nothing about each other.
    #[error("{} and {} are not comparable: {}; compare runs of the same data, or say --force", .first.display(), .other.display(), .differences.join(", "))]
    Incomparable {
        /// The first run.
        first: PathBuf,
        /// One that differs.
        other: PathBuf,
        /// What differs, a line each.
        differences: Vec<String>,
    },
}
