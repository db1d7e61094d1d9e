//! What supports a fix stands in the log and in the table; a joint fix that fails says so.

#![allow(clippy::unwrap_used, reason = "a test may stop at once")]

use std::{collections::HashMap, fs};

use seafix_experiment::{Options, Plan, Silent, run};
use seafix_log::{FrameRecord, Outcome, read};
use tempfile::TempDir;

/// The frames of the log and the rows of the table of an experiment's only trial.
fn made(experiment: &str) -> (Vec<FrameRecord>, Vec<HashMap<String, String>>) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    fs::write(&file, format!("question = 'Why believe it?'\nseed = 5\n{experiment}")).unwrap();
    let plan = Plan::read(&file, &[]).unwrap();
    let out = folder.path().join("run");
    run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let frames = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap().frames;
    let table = fs::read_to_string(out.join("results.csv")).unwrap();
    let mut lines = table.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    (frames, lines.map(|row| head.iter().cloned().zip(row).collect()).collect())
}

#[test]
fn what_supports_a_fix_stands_in_log_and_table() {
    for (points, grade) in [(3, "unmonitored"), (4, "detectable"), (13, "excludable")] {
        let (frames, rows) =
            made(&format!("[source]\nname = 'virtual-layouts'\nlayouts = 2\nframes = 8\npoints = {points}\n"));
        let mut fixes = 0;
        for (frame, row) in frames.iter().zip(&rows) {
            let target = &frame.targets[0];
            if target.outcome != Outcome::Referenced {
                assert!(target.integrity.is_none() && row["redundancy"].is_empty() && row["chi2"].is_empty());
                continue;
            }
            fixes += 1;
            let it = target.integrity.as_ref().unwrap();
            assert_eq!((it.redundancy.as_str(), it.freedom), (grade, 3 * points - 6));
            assert!(it.chi2 > 0.0 || points == 3, "{it:?}");
            assert!(it.chi2 <= it.chi2_limit);
            let number = |name: &str| row[name].parse::<f64>().ok();
            assert_eq!(row["redundancy"], grade);
            assert_eq!(number("chi2_freedom"), Some(it.freedom as f64));
            let columns = ["chi2", "chi2_limit", "separation", "protection_position", "protection_attitude"];
            let logged =
                [Some(it.chi2), Some(it.chi2_limit), it.separation, it.protection_position, it.protection_attitude];
            assert_eq!(columns.map(number), logged);
            assert_eq!(it.protection_position.is_some(), it.protection_attitude.is_some());
            assert!(points != 3 || (it.separation, it.protection_position) == (None, None));
            assert!(points != 13 || it.protection_position.unwrap() > it.separation.unwrap());
        }
        assert!(fixes > 0, "{points} points");
    }
}

/// Half of all true sets fail a test of so little confidence, together as well as alone.
#[test]
fn a_joint_fix_that_fails_says_why() {
    let source = "[source]\nname = 'virtual-layouts'\nlayouts = 2\nobjects = 2\npoints = 12\nframes = 60\nsurvey-sigma = 0.002\n";
    let (frames, _) = made(&format!("{source}[pipeline]\ntarget = 'joint'\n[pipeline.acceptance]\nconfidence = 0.4\n"));
    let fixes = frames.iter().flat_map(|frame| &frame.targets).filter(|target| target.outcome == Outcome::Referenced);
    let (failed, joined): (Vec<_>, Vec<_>) = fixes.partition(|target| !target.detail.is_empty());
    assert!(!failed.is_empty() && !joined.is_empty(), "{} failed, {} joined", failed.len(), joined.len());
    for target in failed {
        assert!(target.detail.starts_with("no joint fix, the pose is that of the object alone: "), "{}", target.detail);
        assert!(target.detail.contains("χ² = "), "{}", target.detail);
    }
}
