//! Laws of a run: its answers depend on the plan alone.

#![allow(clippy::unwrap_used, reason = "a test may stop at once")]

use std::{fs, path::Path};

use seafix_experiment::{Options, Plan, Silent, run};
use seafix_log::{FrameRecord, FrameTimes, TargetTimes, TrialLog, read};
use tempfile::TempDir;

const EXPERIMENT: &str = "question = 'Does the answer depend on the machine?'\nseed = 5\n\
    [source]\nname = 'virtual-points'\nframes = 8\n\
    [[vary]]\nkey = 'pipeline.solver'\nvalues = ['triad', 'kabsch']\n";

/// The logs of an experiment, without what differs from run to run: durations and the run's name.
fn logs(folder: &Path, experiment: &str, settings: &[&str], threads: usize) -> Vec<TrialLog> {
    let file = folder.join("e.toml");
    fs::write(&file, experiment).unwrap();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let plan = Plan::read(&file, &settings).unwrap();
    let out = TempDir::new_in(folder).unwrap();
    run(&plan, &Options { threads, ..Options::into(out.path()) }, &Silent).unwrap();
    plan.trials
        .iter()
        .map(|trial| {
            let mut log = read(&out.path().join(format!("{}.mcap", trial.name))).unwrap();
            log.header.run.clear();
            log.frames.iter_mut().for_each(timeless);
            log
        })
        .collect()
}

fn timeless(frame: &mut FrameRecord) {
    frame.times = FrameTimes::default();
    frame.targets.iter_mut().for_each(|target| target.times = TargetTimes::default());
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let folder = TempDir::new().unwrap();
    assert_eq!(logs(folder.path(), EXPERIMENT, &[], 1), logs(folder.path(), EXPERIMENT, &[], 3));
}

#[test]
fn a_further_frame_changes_no_earlier_one() {
    let folder = TempDir::new().unwrap();
    let short = logs(folder.path(), EXPERIMENT, &["source.frames=5"], 2);
    let long = logs(folder.path(), EXPERIMENT, &[], 2);
    for (short, long) in short.iter().zip(&long) {
        assert_eq!(short.frames, long.frames[..5]);
    }
}

#[test]
fn another_seed_is_another_dive() {
    let folder = TempDir::new().unwrap();
    let (one, other) = (logs(folder.path(), EXPERIMENT, &[], 2), logs(folder.path(), EXPERIMENT, &["seed=6"], 2));
    assert_ne!(one[0].frames[0].cloud, other[0].frames[0].cloud);
}

#[test]
fn a_stored_configuration_makes_its_trial_again() {
    let folder = TempDir::new().unwrap();
    let grid = logs(folder.path(), EXPERIMENT, &[], 2);
    for trial in &grid {
        let again = logs(folder.path(), &trial.header.configuration, &[], 2);
        assert_eq!(again[0].frames, trial.frames);
    }
}

#[test]
fn methods_are_compared_on_the_same_noise() {
    let folder = TempDir::new().unwrap();
    let grid = logs(folder.path(), EXPERIMENT, &[], 2);
    for (triad, kabsch) in grid[0].frames.iter().zip(&grid[1].frames) {
        assert_eq!((&triad.cloud, &triad.prior, &triad.truth), (&kabsch.cloud, &kabsch.prior, &kabsch.truth));
    }
}
