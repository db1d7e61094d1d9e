//! Key frames of experiments: added by one run, read by the next, replayed.

use std::{fs, path::Path};

use seafix_experiment::{Options, Plan, Replay, RunError, Silent, run};
use seafix_log::{FrameRecord, FrameTimes, TargetTimes, read};
use tempfile::TempDir;

/// Five small pairs of a dive, the first of them at an object.
const DIVE: &str = "question = 'Is the ground recognised?'\n[source]\nname = 'dive'\nframes = 5\nrate = 2.0\nstart = 30.4\n\
    rig.size = [512, 384]\nrig.focal = 250.0\nwater.attenuation = 0.15\n\
    [navigation]\npolicy = { name = 'interval', seconds = 100.0 }\n";

fn planned(folder: &Path, name: &str, pose_graph: &str) -> Plan {
    let file = folder.join(name);
    fs::write(&file, format!("{DIVE}pose-graph = {{ {pose_graph} }}\n")).unwrap();
    Plan::read(&file, &[]).unwrap()
}

fn frames(log: &Path) -> Vec<FrameRecord> {
    let mut frames = read(log).unwrap().frames;
    for frame in &mut frames {
        frame.times = FrameTimes::default();
        frame.targets.iter_mut().for_each(|target| target.times = TargetTimes::default());
    }
    frames
}

fn events(frames: &[FrameRecord]) -> Vec<&str> {
    frames.iter().flat_map(|frame| &frame.navigation.as_ref().unwrap().events).map(String::as_str).collect()
}

/// A run writes its key frames, and the next run recognises them. Its replay finds the pose graph file from any folder
/// and gives the same results, on any number of threads.
#[test]
fn a_pose_graph_goes_from_run_to_run() {
    let folder = TempDir::new().unwrap();
    let first = planned(folder.path(), "first.toml", "write-file = true");
    // While this value lives, dives of its seed share surface textures, which take most of the time.
    let _kept = first.trials[0].source.open(first.experiment.seed, &first.folder).unwrap();
    let out = folder.path().join("runs/first");
    fs::create_dir_all(out.parent().unwrap()).unwrap();
    run(&first, &Options { threads: 1, ..Options::into(&out) }, &Silent).unwrap();
    let trial = &first.trials[0].name;
    let first_run = frames(&out.join(format!("{trial}.mcap")));
    assert!(events(&first_run).iter().any(|event| event.starts_with("key frame 0 added")), "{:?}", events(&first_run));
    let pose_graph = format!("runs/first/{trial}.pose-graph");
    assert!(fs::read_to_string(folder.path().join(&pose_graph)).unwrap().contains("seafix-pose-graph/2"));

    let second =
        planned(folder.path(), "second.toml", &format!("read = '{pose_graph}', settings.min-loop-distance = 0.0"));
    let out = folder.path().join("runs/second");
    run(&second, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let log = out.join(format!("{}.mcap", second.trials[0].name));
    let again = frames(&log);
    let found = events(&again).iter().filter(|event| event.contains(" recognised with ")).count();
    assert!(found > 0, "{:?}", events(&again));

    let replay = Replay::default().plan(&log).unwrap();
    let out = folder.path().join("elsewhere");
    run(&replay, &Options { threads: 1, ..Options::into(&out) }, &Silent).unwrap();
    assert_eq!(frames(&out.join(format!("{}.mcap", replay.trials[0].name))), again);
}

/// A pose graph file that is missing, invalid, or another than expected is rejected in one line.
#[test]
fn a_pose_graph_that_is_not_meant_is_rejected() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("none.pose-graph"), "{\"format\": 3}\n").unwrap();
    let message = |pose_graph: &str| {
        let plan = planned(folder.path(), "e.toml", pose_graph);
        let done = run(&plan, &Options::into(folder.path().join("run")), &Silent);
        let Err(RunError::Input(faults)) = done else { panic!("{pose_graph}: {done:?}") };
        assert_eq!(faults.len(), 1, "{faults:?}");
        faults[0].to_string()
    };
    for (pose_graph, what) in [
        ("read = 'missing.pose-graph'", "missing.pose-graph; check the path"),
        ("read = 'none.pose-graph'", "none.pose-graph"),
        ("read = 'none.pose-graph', sha256 = '00'", "a pose graph with another SHA-256 than expected"),
    ] {
        let line = message(pose_graph);
        assert!(line.contains(what) && line.lines().count() == 1, "{line}");
    }
}
