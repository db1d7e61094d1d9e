//! Writing a trial's log.

use std::path::Path;

use crate::{FrameRecord, LogError, TrialHeader};

/// Writes the log of one trial.
#[derive(Debug)]
pub struct Writer {}

impl Writer {
    /// Begins the log of the trial `header` describes at `path` (`….mcap`), in `path` + `.partial`.
    ///
    /// # Errors
    /// [`LogError`] when the file cannot be created or the header contradicts itself.
    pub fn create(path: &Path, header: &TrialHeader) -> Result<Self, LogError> {
        let _ = (path, header);
        Ok(Self {})
    }

    /// Adds one frame; stamps must not decrease.
    ///
    /// # Errors
    /// [`LogError`] when the record contradicts itself or the header, or nothing more can be written.
    pub fn frame(&mut self, frame: &FrameRecord) -> Result<(), LogError> {
        let _ = frame;
        Ok(())
    }

    /// Completes the log: index, check sums, onto the disk, renamed to its own name.
    ///
    /// # Errors
    /// [`LogError`] when any of it fails; the `.partial` then stays.
    pub fn finish(self) -> Result<(), LogError> {
        Ok(())
    }
}
