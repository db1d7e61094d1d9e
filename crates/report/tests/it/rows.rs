//! Runs with many rows.

use std::path::Path;

use seafix_log::{FrameRecord, Writer};

use crate::made_up::{blind, header};

/// Writes a run of two trials with `frames` frames each, without images.
pub(crate) fn write_rows(folder: &Path, frames: u64) {
    for (index, solver) in ["triad", "kabsch"].into_iter().enumerate() {
        let header = header(index + 1, 3.0, solver);
        let mut writer = Writer::create(&folder.join(format!("{}.mcap", header.trial)), &header).unwrap();
        let mut made: Vec<FrameRecord> = (0..60).map(|number| blind(&header, number, 3.0)).collect();
        for number in 0..frames {
            let frame = &mut made[number as usize % 60];
            (frame.frame, frame.stamp_ns) = (number, number * 100_000_000);
            writer.frame(frame).unwrap();
        }
        writer.finish().unwrap();
    }
}
