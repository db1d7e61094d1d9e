//! Coherence problems as frames: from files and generated, with truth and without.

use std::{fs, path::Path};

use seafix::FrameData;
use seafix_data::source::{GeneratedProblems, Source};
use seafix_experiment::{Options, Plan, Silent, run};
use seafix_log::{Evaluation, FrameRecord, Outcome, TargetRecord, TargetTimes, read};
use seafix_simulation::families::{Family, Generated, Presence};
use tempfile::TempDir;

/// The only row of every frame of the only trial, without durations.
fn rows(folder: &Path, experiment: &str) -> Vec<TargetRecord> {
    let file = folder.join("e.toml");
    fs::write(&file, format!("question = 'Which?'\nseed = 1\n{experiment}\n[pipeline]\nsolver = 'mahalanobis'\n"))
        .unwrap();
    let plan = Plan::read(&file, &[]).unwrap();
    let out = TempDir::new_in(folder).unwrap();
    run(&plan, &Options { threads: 2, ..Options::into(out.path()) }, &Silent).unwrap();
    let frames: Vec<FrameRecord> = read(&out.path().join(format!("{}.mcap", plan.trials[0].name))).unwrap().frames;
    frames
        .into_iter()
        .map(|mut frame| {
            assert_eq!(frame.targets.len(), 1, "a problem has one object");
            let mut row = frame.targets.remove(0);
            row.times = TargetTimes::default();
            row
        })
        .collect()
}

/// The problems of a family as `seafix generate` writes them, in folders below `folder`.
fn draw(folder: &Path, family: Family, count: u64) {
    let folder = folder.join(family.name());
    fs::create_dir_all(&folder).unwrap();
    for number in 0..count {
        let Generated { problem, truth } = Generated::new(family, 1, number, Presence::Present);
        let file = |end: &str| folder.join(format!("{}{end}", problem.id));
        fs::write(file(".json"), serde_json::to_string(&problem).unwrap()).unwrap();
        fs::write(file(".truth.json"), serde_json::to_string(&truth).unwrap()).unwrap();
    }
}

const FILES: &str = "source = { name = 'problems', path = 'all' }";

#[test]
fn problems_in_files_are_those_that_were_generated() {
    for (family, count) in [(Family::A, 12), (Family::D, 2), (Family::E, 4)] {
        let folder = TempDir::new().unwrap();
        draw(&folder.path().join("all"), family, count);
        let files = rows(folder.path(), FILES);
        let name = family.name();
        let generated = format!("source = {{ name = 'generated-problems', family = '{name}', frames = {count} }}");
        // The JSON reader is exact except for the last bit: results are equal except for their last digits.
        let essence = |row: &TargetRecord| {
            let Evaluation { wrong, wrong_pairs, visible, identified, correct_pairs, .. } = row.evaluation;
            let counts = (wrong, wrong_pairs, visible, identified, correct_pairs);
            (row.object.clone(), row.outcome, row.reason.clone(), row.pairs.clone(), row.candidates.clone(), counts)
        };
        for (file, generated) in files.iter().zip(rows(folder.path(), &generated)) {
            assert_eq!(essence(file), essence(&generated), "family {name}");
            let [a, b] = [file, &generated].map(|row| row.evaluation.tre_rms.unwrap_or(-1.0));
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        assert!(files.iter().any(|row| row.outcome == Outcome::Fix && row.evaluation.wrong == Some(false)));
    }
}

#[test]
fn truth_is_the_judge_s_alone() {
    let folder = TempDir::new().unwrap();
    draw(&folder.path().join("all"), Family::A, 12);
    let known = rows(folder.path(), FILES);
    let truth = |number: usize| folder.path().join(format!("all/paper-scale/a{number:03}.truth.json"));
    // Another truth changes the evaluation and nothing else.
    let mut moved: serde_json::Value = serde_json::from_str(&fs::read_to_string(truth(4)).unwrap()).unwrap();
    moved["T_cam_obj"][0][3] = 7.0.into();
    fs::write(truth(4), moved.to_string()).unwrap();
    fs::remove_file(truth(6)).unwrap();
    let other = rows(folder.path(), FILES);
    for (index, (known, other)) in known.iter().zip(&other).enumerate() {
        let blind = |row: &TargetRecord| TargetRecord { evaluation: Default::default(), ..row.clone() };
        assert_eq!(blind(known), blind(other));
        assert_eq!(known.evaluation == other.evaluation, ![4, 6].contains(&index), "problem {index}");
    }
    assert_eq!(other[6].evaluation.wrong, None);
}

#[test]
fn every_frame_has_an_object_of_its_own() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    let write = |more: &str| {
        let source = "source = { name = 'generated-problems', frames = 5, first = 3 }";
        fs::write(
            &file,
            format!("question = 'Which?'\nseed = 1\n{source}\n[pipeline]\nsolver = 'mahalanobis'\n{more}"),
        )
        .unwrap();
        Plan::read(&file, &[]).unwrap()
    };
    let (plan, out) = (write(""), folder.path().join("out"));
    run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let log = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap();
    assert!(log.header.targets.is_empty() && log.header.site.is_empty());
    for (frame, number) in log.frames.iter().zip(3..) {
        let generated = Generated::new(Family::A, 1, number, Presence::Present).problem;
        let model = frame.model(&log.header, &frame.targets[0].object).unwrap();
        assert_eq!(model.id, generated.id);
        assert_eq!(model.points.iter().map(|point| point.at).collect::<Vec<_>>(), generated.model);
    }
    // A coherence problem needs a single object as target.
    for kind in ["site", "joint"] {
        let message = run(&write(&format!("target = '{kind}'")), &Options::into(folder.path().join(kind)), &Silent);
        assert!(message.unwrap_err().to_string().contains("use target = \"object\""));
    }
}

#[test]
fn of_any_number_of_problems_only_those_examined_are_generated() {
    let source = GeneratedProblems { frames: 1_000_000_000, ..GeneratedProblems::default() };
    let sequence = source.open(1, Path::new(".")).unwrap();
    let last = sequence.frames() - 1;
    let generated = Generated::new(Family::A, 1, last as u64, Presence::Present);
    let (FrameData::Points(cloud), Some(truth)) =
        (sequence.sensor_frame(last).unwrap().frame_data, sequence.truth(last))
    else {
        panic!("points and truth")
    };
    assert_eq!(
        (cloud.len(), truth.answer.unwrap().pairs.len()),
        (generated.problem.cloud.len(), generated.truth.pairs.len())
    );
}

#[test]
fn any_pose_is_wrong_where_none_is_defined() {
    let folder = TempDir::new().unwrap();
    let absent = "source = { name = 'generated-problems', family = 'paper-scale', frames = 40, absent = true }";
    for row in rows(folder.path(), absent) {
        assert_eq!(row.evaluation.wrong, Some(row.outcome == Outcome::Fix));
    }
}

#[test]
fn faults_name_the_file() {
    let folder = TempDir::new().unwrap();
    let all = folder.path().join("all");
    draw(&all, Family::A, 2);
    let file = folder.path().join("e.toml");
    let message = |pipeline: &str| {
        fs::write(&file, format!("question = 'Which?'\n{FILES}\n[pipeline]\n{pipeline}\n")).unwrap();
        match Plan::read(&file, &[]) {
            Err(faults) => faults[0].to_string(),
            Ok(plan) => run(&plan, &Options { threads: 1, ..Options::into(folder.path().join("out")) }, &Silent)
                .unwrap_err()
                .to_string(),
        }
    };
    let pixels = message("solver = 'stereo-reprojection'");
    assert!(
        pixels.contains("needs pixels") && pixels.contains("use `mahalanobis` in ") && pixels.contains("e.toml:4"),
        "{pixels}"
    );
    assert!(message("").contains("needs pixels"));
    let sound = "solver = 'mahalanobis'";
    fs::copy(all.join("paper-scale/a000.json"), all.join("paper-scale/a009.json")).unwrap();
    assert!(message(sound).contains("two problems with the same `id`"));
    fs::write(all.join("paper-scale/a009.json"), "{").unwrap();
    assert!(message(sound).contains("a009.json:1"));
    fs::remove_file(all.join("paper-scale/a009.json")).unwrap();
    fs::write(all.join("paper-scale/a001.truth.json"), r#"{"T_cam_obj": [], "pairs": [], "pose_defined": false}"#)
        .unwrap();
    assert!(message(sound).contains("a001.truth.json"));
    fs::remove_dir_all(&all).unwrap();
    assert!(message(sound).contains("no such file or folder"));
    fs::create_dir(&all).unwrap();
    assert!(message(sound).contains("no coherence problem in"));
    assert!(!folder.path().join("out").exists(), "nothing is written before inputs are checked");
}
