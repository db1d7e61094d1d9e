//! What is written comes back, and nothing else does.

use std::fs;

use seafix_log::{FrameRecord, LogError, Reader, Totals, Writer, read};

use crate::synthetic;

/// Seen to fail without a field of a result.
#[test]
fn every_record_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 7);
    let log = read(&path).unwrap();
    assert_eq!(log.header, synthetic::header());
    assert_eq!(log.frames, (0..7).map(synthetic::frame).collect::<Vec<_>>());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the .partial is gone");
    if let Some(keep) = std::env::var_os("KEEP_LOG") {
        fs::copy(&path, keep).unwrap();
    }
}

#[test]
fn images_can_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 3);
    let mut reader = Reader::open(&path).unwrap().without_images();
    assert!(!reader.has_images());
    for (number, frame) in reader.by_ref().enumerate() {
        let mut expected = synthetic::frame(number as u64);
        expected.images = None;
        assert_eq!(frame.unwrap(), expected);
    }
    assert!(reader.has_images());
}

/// Bare frames are the frames without what they say that they leave out, and nothing else is lost.
///
/// Seen to fail without the truth, without the pixels and without the navigation.
#[test]
fn bare_frames_have_what_results_need() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 7);
    for (number, bare) in Reader::open(&path).unwrap().without_images().bare().enumerate() {
        let (mut bare, mut expected) = (bare.unwrap(), synthetic::frame(number as u64));
        expected.images = None;
        expected.prior = None;
        expected.lines.clear();
        if let Some(truth) = &mut expected.truth {
            truth.visible.clear();
        }
        assert!(bare.cloud.iter().all(|point| point.at.iter().all(|x| x.is_nan())));
        let pixels = |frame: &mut FrameRecord| frame.cloud.drain(..).map(|point| point.pixels).collect::<Vec<_>>();
        assert_eq!(pixels(&mut bare), pixels(&mut expected));
        assert_eq!(bare, expected);
    }
}

#[test]
fn frames_decoded_side_by_side_are_those_read_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    // More than are decoded at a time.
    synthetic::write(&path, 300);
    let bare = |mut frame: FrameRecord| {
        (frame.images, frame.inputs) = (None, None);
        frame
    };
    let expected: Vec<FrameRecord> = read(&path).unwrap().frames.into_iter().map(bare).collect();
    let mut all = Vec::new();
    let mut reader = Reader::open(&path).unwrap().without_images().without_inputs();
    reader.for_each_frame(|frame| all.push(frame)).unwrap();
    assert_eq!(all, expected);
    assert!(reader.has_images() && reader.totals().is_some());
    assert!(reader.next().is_none());
    let full = fs::read(&path).unwrap();
    fs::write(&path, &full[..full.len() / 2]).unwrap();
    let cut_off = Reader::open(&path).unwrap().for_each_frame(drop).unwrap_err();
    assert!(matches!(cut_off, LogError::Truncated { .. }), "{cut_off}");
}

/// Seen to fail when messages bear the time of their writing.
#[test]
fn the_same_records_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| {
        synthetic::write(&folder.path().join(name), 4);
        fs::read(folder.path().join(name)).unwrap()
    });
    assert!(a == b);
}

#[test]
fn a_trial_without_frames_is_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 0);
    assert_eq!(read(&path).unwrap().frames, []);
}

#[test]
fn totals_come_back_after_the_last_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    let mut totals = Totals { every: 3, failures_left_out: 2, ..Totals::default() };
    let mut writer = Writer::create(&path, &synthetic::header()).unwrap();
    for number in 0..4 {
        let frame = synthetic::frame(number);
        totals.add(&frame);
        writer.frame(&frame).unwrap();
    }
    assert_eq!((totals.frames, totals.attempted, totals.found, totals.rejected()), (4, 6, 3, 3));
    assert_eq!(totals.regions, Some([3, 0, 0, 0, 0, 0]), "an error of 10 mm, a level of 30, a limit of 50");
    let mut twice = totals.clone();
    twice.merge(&totals);
    assert_eq!(twice.regions, Some([6, 0, 0, 0, 0, 0]));
    assert_eq!((totals.judged, totals.bounded, totals.nees_count, totals.nees_within), (3, 0, 3, 3));
    writer.totals(&totals).unwrap();
    writer.finish().unwrap();
    let mut reader = Reader::open(&path).unwrap();
    assert_eq!(reader.totals(), None, "they stand last");
    assert_eq!(reader.by_ref().count(), 4);
    assert_eq!(reader.totals(), Some(&totals));
}

#[test]
fn a_dropped_writer_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    let mut writer = Writer::create(&path, &synthetic::header()).unwrap();
    writer.frame(&synthetic::frame(0)).unwrap();
    drop(writer);
    assert!(!path.exists());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn records_that_contradict_themselves_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(&folder.path().join("t.mcap"), &synthetic::header()).unwrap();
    writer.frame(&synthetic::frame(1)).unwrap();
    let complaint = |writer: &mut Writer, frame| match writer.frame(&frame) {
        Err(LogError::Record { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    assert!(complaint(&mut writer, synthetic::frame(0)).contains("must not decrease"));
    let mut frame = synthetic::frame(2);
    frame.targets[0].pairs[0].cloud = 12;
    assert!(complaint(&mut writer, frame).contains("cloud point 12 of 12"));
    let mut frame = synthetic::frame(2);
    frame.targets[0].object_from_camera.as_mut().unwrap()[0][0] = f64::NAN;
    assert!(complaint(&mut writer, frame).contains("finite"));
    let mut frame = synthetic::frame(2);
    frame.images.as_mut().unwrap()[1].width = 63;
    assert!(complaint(&mut writer, frame).contains("63 x 48"));
    let mut frame = synthetic::frame(2);
    frame.targets.clear();
    assert!(complaint(&mut writer, frame).contains("empty object"));
}
