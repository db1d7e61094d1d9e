//! Reading a trial's log.

use std::path::Path;

use crate::{FrameRecord, LogError, TrialHeader};

/// A whole trial, as its log has it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialLog {
    /// What the trial is.
    pub header: TrialHeader,
    /// Its frames, in order.
    pub frames: Vec<FrameRecord>,
}

/// Reads the log at `path` back into the records it was written from.
///
/// # Errors
/// [`LogError`] when the file is no MCAP file, cut off, damaged, or no log of a trial: never a silent
/// short result.
pub fn read(path: &Path) -> Result<TrialLog, LogError> {
    Err(LogError::NotMcap { path: path.to_owned(), looks_like: String::new() })
}
