//! Laws of replays: a log holds the exact inputs of its pipeline.

use std::{fs, path::Path};

use seafix_experiment::{Options, Plan, Replay, ReplayFrom, Silent, run};
use seafix_log::{FrameRecord, FrameTimes, TargetTimes, read};
use tempfile::TempDir;

/// Sources of every kind, shortened, with a pipeline for their frames.
const EXPERIMENTS: [(&str, &str); 8] = [
    ("points", "[source]\nname = 'virtual-points'\nframes = 6\n"),
    ("images", "[source]\nname = 'virtual-images'\nframes = 2\nrig.size = [512, 384]\nrig.focal = 250.0\n"),
    (
        "readings",
        "[source]\nname = 'dive'\nframes = 5\nrate = 2.0\nrig.size = [512, 384]\nrig.focal = 250.0\n[navigation]\nodometry = 'dvl-gyro'\npolicy = { name = 'interval', seconds = 1.0 }\n",
    ),
    ("edges", "[source]\nname = 'dive'\nframes = 2\nroute.altitude = 2.5\nrig.size = [512, 384]\nrig.focal = 250.0\n"),
    ("layouts", "[source]\nname = 'virtual-layouts'\nlayouts = 3\nframes = 6\nsurvey-sigma = 0.01\n"),
    (
        "joint",
        "[source]\nname = 'virtual-layouts'\nlayouts = 2\nobjects = 3\nframes = 6\nsurvey-sigma = 0.002\n[pipeline]\ntarget = 'joint'\nwindow = 3\n",
    ),
    ("site", "[source]\nname = 'virtual-points'\nframes = 3\n[pipeline]\ntarget = 'site'\n"),
    ("problems", "[source]\nname = 'generated-problems'\nframes = 8\n[pipeline]\nsolver = 'mahalanobis'\n"),
];

/// The frames of the only trial of a plan, without durations.
fn frames(plan: &Plan, folder: &Path, threads: usize) -> Vec<FrameRecord> {
    let out = TempDir::new_in(folder).unwrap();
    run(plan, &Options { threads, ..Options::into(out.path()) }, &Silent).unwrap();
    frames_of(&out.path().join(format!("{}.mcap", plan.trials[0].name)))
}

fn frames_of(log: &Path) -> Vec<FrameRecord> {
    let mut frames = read(log).unwrap().frames;
    for frame in &mut frames {
        frame.times = FrameTimes::default();
        frame.targets.iter_mut().for_each(|target| target.times = TargetTimes::default());
    }
    frames
}

/// The plan of an experiment, and the log of its run.
fn logged(folder: &Path, experiment: &str, settings: &[&str]) -> (Plan, std::path::PathBuf) {
    let file = folder.join("e.toml");
    fs::write(&file, format!("question = 'Again?'\nseed = 5\n{experiment}")).unwrap();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let plan = Plan::read(&file, &settings).unwrap();
    let out = folder.join("run");
    run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let log = out.join(format!("{}.mcap", plan.trials[0].name));
    (plan, log)
}

/// The record of a replay from clouds has neither images nor key points.
fn without_images(mut frames: Vec<FrameRecord>) -> Vec<FrameRecord> {
    for frame in &mut frames {
        (frame.images, frame.key_points) = (None, Vec::new());
        frame.inputs.as_mut().unwrap().exact_images = false;
    }
    frames
}

#[test]
fn the_logged_configuration_gives_the_logged_results() {
    for (name, experiment) in EXPERIMENTS {
        let folder = TempDir::new().unwrap();
        let (plan, log) = logged(folder.path(), experiment, &[]);
        let original = frames_of(&log);
        assert!(!original.is_empty(), "{name}");
        for threads in [1, 3] {
            let replay = Replay::default().plan(&log).unwrap();
            assert_eq!(replay.trials[0].name, plan.trials[0].name);
            let again = frames(&replay, folder.path(), threads);
            assert_eq!(without_images(again), without_images(original.clone()), "{name}, {threads} threads");
            let reported: usize = original.iter().map(|frame| frame.inputs.as_ref().unwrap().readings.len()).sum();
            let moved = original.iter().filter_map(|frame| frame.navigation.as_ref()?.odometry.motion).count();
            assert!(name != "readings" || reported > 20 && moved == 4, "{reported} readings, {moved} motions");
        }
        let edges = original.iter().flat_map(|frame| &frame.targets).map(|target| target.edges.len()).sum::<usize>();
        assert_eq!(edges > 0, ["edges", "readings"].contains(&name), "{name}: {edges} identified edges");
        if name == "images" {
            let replay = Replay { from: ReplayFrom::Images, ..Replay::default() }.plan(&log).unwrap();
            assert_eq!(frames(&replay, folder.path(), 2), original);
        }
    }
}

#[test]
fn another_method_on_the_logged_inputs_is_that_method_on_the_experiment() {
    for (name, experiment) in EXPERIMENTS.into_iter().filter(|(name, _)| *name != "joint") {
        let folder = TempDir::new().unwrap();
        let (_, log) = logged(folder.path(), experiment, &[]);
        let other = TempDir::new().unwrap();
        let (_, expected) =
            logged(other.path(), experiment, &["pipeline.search=maximum-clique", "pipeline.solver=kabsch"]);
        let replay = Replay {
            searches: vec!["maximum-clique".to_owned()],
            solvers: vec!["kabsch".to_owned()],
            ..Replay::default()
        };
        let again = frames(&replay.plan(&log).unwrap(), folder.path(), 2);
        assert_eq!(without_images(again), without_images(frames_of(&expected)), "{name}");
    }
}

#[test]
fn another_detector_needs_the_images() {
    let folder = TempDir::new().unwrap();
    let experiment = "[source]\nname = 'virtual-images'\nframes = 1\nrig.size = [512, 384]\nrig.focal = 250.0\n";
    let (_, log) = logged(folder.path(), experiment, &[]);
    let detector = "pipeline.detector=fast";
    let replay = Replay { settings: vec![detector.to_owned()], ..Replay::default() };
    let again = frames(&replay.plan(&log).unwrap(), folder.path(), 1);
    let other = TempDir::new().unwrap();
    assert_eq!(again, frames_of(&logged(other.path(), experiment, &[detector]).1));

    let points = TempDir::new().unwrap();
    let (_, log) = logged(points.path(), EXPERIMENTS[0].1, &[]);
    let plan = replay.plan(&log).unwrap();
    let rejected = run(&plan, &Options { threads: 1, ..Options::into(points.path().join("out")) }, &Silent)
        .unwrap_err()
        .to_string();
    assert!(rejected.contains("a log without images"), "{rejected}");
}

#[test]
fn several_methods_are_a_trial_each() {
    let folder = TempDir::new().unwrap();
    let (_, log) = logged(folder.path(), EXPERIMENTS[0].1, &[]);
    let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<String>>();
    let replay = Replay { solvers: names(&["kabsch", "triad"]), ..Replay::default() };
    let plan = replay.plan(&log).unwrap();
    assert_eq!(
        plan.trials.iter().map(|trial| &*trial.name).collect::<Vec<_>>(),
        ["001-solver-kabsch", "002-solver-triad"]
    );
    let wrong = Replay { solvers: names(&["kabsh"]), ..Replay::default() }.plan(&log).unwrap_err();
    assert!(wrong[0].to_string().contains("did you mean `kabsch`"), "{}", wrong[0]);
    let seed = Replay { settings: names(&["seed=6"]), ..Replay::default() }.plan(&log).unwrap_err();
    assert!(seed[0].to_string().contains("run the experiment again"), "{}", seed[0]);
}

#[test]
fn a_damaged_log_is_not_replayed() {
    let folder = TempDir::new().unwrap();
    let (_, log) = logged(folder.path(), EXPERIMENTS[0].1, &[]);
    let bytes = fs::read(&log).unwrap();
    let plan = Replay::default().plan(&log).unwrap();
    let message = |bytes: &[u8]| {
        fs::write(&log, bytes).unwrap();
        run(&plan, &Options { threads: 1, ..Options::into(folder.path().join("out")) }, &Silent)
            .unwrap_err()
            .to_string()
    };
    assert!(message(&bytes[..bytes.len() - 30]).contains("no footer"));
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    let rejected = message(&flipped);
    assert!(rejected.contains("damaged") && rejected.contains("byte"), "{rejected}");
    assert!(message(b"SQLite format 3\0").contains("ROS 2 bag in SQLite"));
    assert!(!folder.path().join("out").exists());
}
