//! Output of a source's stereo pairs as a data set, with progress.

use std::path::Path;

use seafix_data::{dataset, source::Sequence};

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT},
    terminal::{Progress, notify, print},
};

/// Writes all frames of `sequence` to the folder `out`, which must not exist.
pub(super) fn write(sequence: &dyn Sequence, out: &Path, licence: &str) -> Ended {
    let progress = Progress::new();
    let count = sequence.frames();
    notify(&format!("{count} frames in {}", out.display()));
    progress.expect(count);
    let written = dataset::write(sequence, out, licence, &|| progress.step(""));
    progress.end();
    written.map_err(|fault| Failure::new(OUTPUT, fault))?;
    print(&format!("{count} stereo pairs in {}\n", out.display()))?;
    Ok(DONE)
}
