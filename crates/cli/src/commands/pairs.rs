//! Writing the stereo pairs of a source as a data set, with the user told how far it is.

use std::path::Path;

use seafix_data::{dataset, source::Passage};

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT},
    terminal::{Progress, print, tell},
};

/// Writes all frames of `passage` to the folder `out`, which must not exist.
pub(super) fn write(passage: &dyn Passage, out: &Path, licence: &str) -> Ended {
    let progress = Progress::new();
    let count = passage.frames();
    tell(&format!("{count} frames into {}", out.display()));
    progress.expect(count);
    let written = dataset::write(passage, out, licence, &|| progress.step(""));
    progress.end();
    written.map_err(|fault| Failure::new(OUTPUT, fault))?;
    print(&format!("{count} stereo pairs in {}\n", out.display()))?;
    Ok(DONE)
}
