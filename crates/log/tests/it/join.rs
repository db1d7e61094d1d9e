//! Logs of parts become the log of the whole, byte for byte.

use std::{fs, ops::Range, path::Path};

use seafix_log::{LogError, Totals, Writer, join, read};

use crate::synthetic;

/// The log of some frames with their totals, as a part or as the whole.
fn write(path: &Path, frames: Range<u64>, part: bool) {
    let create = if part { Writer::piece } else { Writer::create };
    let mut writer = create(path, &synthetic::header()).unwrap();
    // Sums of whole numbers, which are not rounded.
    let count = frames.end - frames.start;
    let totals = Totals { every: 1, frames: count, tre_squares: count as f64, ..Totals::default() };
    for number in frames {
        writer.frame(&synthetic::frame(number)).unwrap();
    }
    writer.totals(&totals).unwrap();
    writer.finish().unwrap();
}

#[test]
fn where_parts_end_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("whole.mcap"), 0..9, false);
    let full = fs::read(at("whole.mcap")).unwrap();
    for cuts in [&[0, 9][..], &[0, 1, 9], &[0, 4, 4, 7, 9]] {
        let parts: Vec<_> = cuts
            .windows(2)
            .map(|cut| {
                let part = at(&format!("{}-{}.mcap", cut[0], cut[1]));
                write(&part, cut[0]..cut[1], true);
                part
            })
            .collect();
        assert!(join(&parts, &at("joined.mcap"), || true).unwrap());
        assert!(fs::read(at("joined.mcap")).unwrap() == full, "cut at {cuts:?}");
    }
}

#[test]
fn a_part_of_another_trial_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("a.mcap"), 0..2, true);
    let other = seafix_log::TrialHeader { question: "another".to_owned(), ..synthetic::header() };
    Writer::piece(&at("b.mcap"), &other).unwrap().finish().unwrap();
    let error = join(&[at("a.mcap"), at("b.mcap")], &at("joined.mcap"), || true).unwrap_err();
    assert!(matches!(error, LogError::Foreign { .. }), "{error}");
    assert!(!at("joined.mcap").exists());
}

#[test]
fn a_part_that_is_damaged_ends_the_joining() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("a.mcap"), 0..2, true);
    let mut bytes = fs::read(at("a.mcap")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(at("a.mcap"), bytes).unwrap();
    assert!(join(&[at("a.mcap")], &at("joined.mcap"), || true).is_err());
}

#[test]
fn joining_stops_when_it_is_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("a.mcap"), 0..2, true);
    write(&at("b.mcap"), 2..3, true);
    let mut asked = 0;
    let go_on = || {
        asked += 1;
        asked < 2
    };
    assert!(!join(&[at("a.mcap"), at("b.mcap")], &at("joined.mcap"), go_on).unwrap());
    assert!(!at("joined.mcap").exists());
    // Later it may begin anew.
    assert!(join(&[at("a.mcap"), at("b.mcap")], &at("joined.mcap"), || true).unwrap());
    assert_eq!(read(&at("joined.mcap")).unwrap().frames.len(), 3);
}
