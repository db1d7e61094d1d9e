//! The observer of a run.

use std::path::Path;

use seafix_component::Fault;

/// An observer of a run that may stop it. The runner itself prints nothing.
pub trait Observer: Sync {
    /// Reports the start: the number of frames over all trials, the approximate size of the logs, and the folder.
    fn begins(&self, _frames: usize, _bytes: u64, _folder: &Path) {}
    /// Reports the number of frames kept from before an interruption.
    fn resumes(&self, _frames: usize) {}
    /// Reports that an existing run is repeated, and the reason.
    fn renews(&self, _reason: &str) {}
    /// Reports a warning about an input.
    fn warns(&self, _warning: &Fault) {}
    /// Reports that one more frame of `trial` is logged.
    fn frame(&self, _trial: &str) {}
    /// Whether to stop the run; each thread then finishes its frame.
    fn stops(&self) -> bool {
        false
    }
}

/// An observer without output.
#[derive(Debug, Clone, Copy)]
pub struct Silent;
impl Observer for Silent {}
