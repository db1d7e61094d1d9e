//! What can go wrong with a report.

use std::path::PathBuf;

use seafix_log::LogError;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder holds no log.
    #[error("{} holds no *.mcap: it is not the folder of a run", .0.display())]
    NoLogs(PathBuf),
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
    #[error("cannot {doing} {}: {source}; is there room, and may this user {doing} there?", .path.display())]
    Io {
        /// `read` or `write`.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A picture cannot be encoded.
    #[error("cannot draw the picture of frame {frame} of {}: {message}", .path.display())]
    Picture {
        /// The log.
        path: PathBuf,
        /// The frame.
        frame: u64,
        /// What the encoder said.
        message: String,
    },
}
