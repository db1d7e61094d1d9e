//! The answers about displaced objects, points of interest, company in view and bounds.

use std::path::Path;

use seafix_log::{Axis, Evaluation, FrameRecord, Outcome, TrialHeader, Writer};

use crate::{
    answers::page,
    made_up::{blind, header},
};

/// Writes a trial of forty frames of two objects, `manifold` and `pod`, changed by `change`.
fn trial(
    folder: &Path,
    index: usize,
    [key, value]: [&str; 2],
    question: &str,
    configuration: &str,
    change: impl Fn(&TrialHeader, &mut FrameRecord),
) {
    let mut header = header(index, 3.0, "kabsch");
    header.trial = format!("{index:03}");
    header.axes = vec![Axis { key: key.to_owned(), value: value.to_owned() }];
    header.question = question.to_owned();
    header.configuration += configuration;
    header.targets[0].id = "manifold".to_owned();
    let mut pod = header.targets[0].clone();
    pod.id = "pod".to_owned();
    header.targets.push(pod);
    let mut writer = Writer::create(&folder.join(format!("{}.mcap", header.trial)), &header).unwrap();
    for number in 0..40 {
        let mut frame = blind(&header, 0, 3.0);
        (frame.frame, frame.stamp_ns) = (number, 100 * number);
        let mut pod = frame.targets[0].clone();
        pod.object = "pod".to_owned();
        frame.targets.push(pod);
        change(&header, &mut frame);
        writer.frame(&frame).unwrap();
    }
    writer.finish().unwrap();
}

/// Turns an attempt into a rejected one.
fn reject(frame: &mut FrameRecord, place: usize) {
    let target = &mut frame.targets[place];
    target.outcome = Outcome::Rejected;
    target.reason = "too-few".to_owned();
    target.evaluation = Evaluation { wrong: Some(false), visible: Some(9), ..Evaluation::default() };
}

/// No fix in forty attempts, which count as ten, is below all of them: [0, 30.8] and [69.2, 100] %.
#[test]
fn a_displaced_object_and_its_neighbours_are_answered_apart() {
    let folder = tempfile::tempdir().unwrap();
    let question = "Does a displaced object get a fix, and does it mislead the fixes of its neighbours?";
    for (index, shift) in ["0.0", "0.5"].into_iter().enumerate() {
        let configuration = "[source.changes]\nobjects = [\"pod\"]\n";
        let axis = ["source.changes.shift", shift];
        trial(folder.path(), index + 1, axis, question, configuration, |_, frame| {
            frame.targets[0].evaluation.position_error = Some(0.004);
            if index == 1 {
                reject(frame, 1);
            }
        });
    }
    let text = page(folder.path());
    let expected = "No, the displaced pod gets no fix: at shift 0.5 m in 0.0 % [0.0, 30.8] of 40 attempts, at shift 0.0 m in \
                    100.0 % [69.2, 100.0] of 40; that it misleads its neighbours is not shown: their largest median \
                    position error is 4.0 mm [4.0, 4.0] at shift 0.5 m and 4.0 mm [4.0, 4.0] at shift 0.0 m; 0 wrong";
    assert!(text.contains(expected), "{text}");
}

/// Frames with two objects have a fix, those with one have none; both kinds stand in runs of ten frames.
#[test]
fn company_in_view_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let question = "Up to which height does an object get a fix, and do several objects in view help?";
    for (index, altitude) in ["2.0", "3.0"].into_iter().enumerate() {
        trial(folder.path(), index + 1, ["source.altitude", altitude], question, "", |_, frame| {
            if index == 0 || frame.frame < 20 {
                frame.targets.truncate(1);
                reject(frame, 0);
            }
        });
    }
    let text = page(folder.path());
    // Twenty frames count as seven blocks of three.
    let expected = "; several objects in view help: at altitude 3.0 m, frames have a fix in 100.0 % [";
    assert!(text.contains(expected), "{text}");
    assert!(text.contains("] of 20 with several in view and in 0.0 % [0.0, "), "{text}");
}
