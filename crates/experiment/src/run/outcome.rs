//! The outcome of a run: a complete folder, or the reason why there is none.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_log::LogError;

/// The reason why a run was not finished.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Invalid inputs; nothing was written.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Input(Vec<Fault>),
    /// An output that cannot be written.
    #[error("{0}")]
    Output(Fault),
    /// A log that cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An interruption by the observer; the finished part is kept.
    #[error("interrupted; resume with `--resume --out {}`, or recover the finished part with `seafix recover {}`", .0.display(), .0.display())]
    Interrupted(PathBuf),
}

impl RunError {
    /// The fault of a file that cannot be written, with the number of bytes written before.
    pub(crate) fn unwritable(path: &Path, error: impl std::fmt::Display) -> Self {
        let after =
            std::fs::metadata(path).map_or_else(|_| String::new(), |file| format!(", after {} bytes", file.len()));
        Self::Output(
            Fault::new(format!("cannot write ({error}{after})"), path).remedy("free some disk space and use --resume"),
        )
    }
}

/// A complete run or shard.
#[derive(Debug)]
pub struct Finished {
    /// The folder.
    pub folder: PathBuf,
    /// The number of attempts over all trials and frames; zero for a shard.
    pub rows: usize,
    /// Whether the run existed already and nothing was computed.
    pub kept: bool,
}
