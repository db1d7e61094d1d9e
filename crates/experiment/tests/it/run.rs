//! Laws of a run: its results depend on the plan alone.

use std::{collections::BTreeMap, fs, path::Path};

use seafix_experiment::{Existing, Options, Plan, Silent, kept_identity, remake, run};
use seafix_log::{FrameRecord, FrameTimes, SharedStages, TargetTimes, TrialLog, read};
use tempfile::TempDir;

const EXPERIMENT: &str = "question = 'Does the answer depend on the machine?'\nseed = 5\n\
    [source]\nname = 'virtual-points'\nframes = 8\n\
    [[vary]]\nkey = 'pipeline.solver'\nvalues = ['triad', 'kabsch']\n";

/// The logs of an experiment, without the quantities that differ from run to run: durations and the run's name.
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

/// Seen to fail when streams of random numbers depend on the thread.
#[test]
fn the_number_of_threads_changes_nothing() {
    let folder = TempDir::new().unwrap();
    assert_eq!(logs(folder.path(), EXPERIMENT, &[], 1), logs(folder.path(), EXPERIMENT, &[], 3));
}

/// Seen to fail when streams of random numbers depend on the thread.
#[test]
fn a_further_frame_changes_no_earlier_one() {
    let folder = TempDir::new().unwrap();
    let short = logs(folder.path(), EXPERIMENT, &["source.frames=5"], 2);
    let long = logs(folder.path(), EXPERIMENT, &[], 2);
    for (short, long) in short.iter().zip(&long) {
        assert_eq!(short.frames, long.frames[..5]);
    }
}

/// Seen to fail when the seed has no effect.
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

/// Five pairs of a dive at 5 Hz, with a fix every half second.
const SESSION: &str = "question = 'Does the trajectory between fixes hold?'\n\
    [source]\nname = 'dive'\nframes = 5\nrate = 5.0\nstart = 30.4\n\
    rig.size = [512, 384]\nrig.focal = 250.0\nwater.attenuation = 0.15\n\
    [navigation]\npolicy = { name = 'interval', seconds = 0.5 }\n";

/// A fix is taken at the first pair and after half a second; odometry carries the pose between them without a large
/// error.
#[test]
fn a_pose_is_carried_between_fixes() {
    let folder = TempDir::new().unwrap();
    let log = logs(folder.path(), SESSION, &[], 2).remove(0);
    let known: Vec<_> = log.frames.iter().map(|frame| frame.navigation.as_ref().unwrap()).collect();
    let tried: Vec<bool> = known.iter().map(|known| known.due).collect();
    assert_eq!(tried, [true, false, false, true, false], "{known:#?}");
    for (frame, known) in log.frames.iter().zip(&known) {
        assert_eq!(known.due, frame.targets[0].reason != "not-due");
        let state = if known.due { "fix" } else { "dead reckoning" };
        assert_eq!(known.state, state, "{known:#?}");
        assert_eq!(known.odometry.motion.is_some(), frame.frame > 0);
        // Both are carried from the first fix; after the second they differ.
        let (position, alone) =
            (known.errors.position_error.unwrap(), known.errors.odometry_only_position_error.unwrap());
        assert!(position < 0.03 && alone < 0.03, "frame {}: {position} {alone}", frame.frame);
        assert_eq!(position == alone, frame.frame < 3);
    }
}

/// Images are black when a fix is due: the pose is kept, the frame has no fix, and the log states how the state
/// continued.
///
/// Seen to fail when a frame without motion is in state `prior` and no fix is due.
#[test]
fn images_without_content_leave_the_pose_known() {
    let folder = TempDir::new().unwrap();
    let dark = "source.faults=[{ device = 'images', kind = 'off', from = 30.9, to = 31.1, amount = 0.0 }]";
    let log = logs(folder.path(), SESSION, &[dark], 2).remove(0);
    let states: Vec<&str> = log.frames.iter().map(|frame| &*frame.navigation.as_ref().unwrap().state).collect();
    assert_eq!(states, ["fix", "dead reckoning", "dead reckoning", "dead reckoning", "fix"]);
    let black = &log.frames[3];
    let known = black.navigation.as_ref().unwrap();
    assert_eq!((&*black.targets[0].reason, known.due, &known.pose), ("no-data", true, &None), "{known:#?}");
    let events: Vec<&String> = log.frames.iter().flat_map(|frame| &frame.navigation.as_ref().unwrap().events).collect();
    assert!(events.iter().all(|event| !event.contains("→ prior")), "{events:#?}");
}

#[test]
fn settings_of_navigation_are_checked() {
    let folder = TempDir::new().unwrap();
    let message = |experiment: &str| {
        let file = folder.path().join("e.toml");
        fs::write(&file, experiment).unwrap();
        match Plan::read(&file, &[]) {
            Err(faults) => faults[0].to_string(),
            Ok(plan) => run(&plan, &Options::into(folder.path().join("run")), &Silent).unwrap_err().to_string(),
        }
    };
    let dive = "question = 'why'\nsource = 'dive'\n";
    assert!(message(&format!("{dive}[navigation]\npolicy = 'intervals'\n")).contains("interval"));
    assert!(message(&format!("{dive}[pipeline]\ntarget = 'joint'\n[navigation]\n")).contains("target = \"object\""));
    let points = "question = 'why'\nsource = 'virtual-points'\n[navigation]\n";
    assert!(message(points).contains("navigation needs images"), "{}", message(points));
    // An odometry that requires readings is rejected without them, by the plan or when the source is opened.
    let by_readings = "[navigation]\nodometry = 'dvl-gyro'\n";
    let none = message(&format!("question = 'why'\nsource = 'virtual-images'\n{by_readings}"));
    assert!(none.contains("e.toml:4") && none.contains("which source `virtual-images` does not have"), "{none}");
    let off = "faults = [{ device = 'doppler', kind = 'off', from = 0.0, to = 1e4, amount = 0.0 }]";
    let deaf = message(&format!("question = 'why'\n[source]\nname = 'dive'\nframes = 2\n{off}\n{by_readings}"));
    assert!(deaf.contains("which this source does not have") && deaf.lines().count() == 1, "{deaf}");
}

/// The logging of images changes no result.
#[test]
fn images_may_be_left_out_of_the_log() {
    let folder = TempDir::new().unwrap();
    let level = |images: &str| {
        let settings = ["source.frames=1", &format!("log.images={images}")];
        logs(folder.path(), "question = 'why'\nsource = 'virtual-images'\n", &settings, 1).remove(0).frames.remove(0)
    };
    let [all, small, none] = ["all", "thumbnails", "none"].map(level);
    let size = |frame: &FrameRecord| frame.images.as_ref().map(|[left, _]| [left.width, left.height]);
    assert_eq!([size(&all), size(&small), size(&none)], [Some([1024, 768]), Some([256, 192]), None]);
    for frame in [small, none] {
        assert_eq!((&frame.targets, &frame.cloud), (&all.targets, &all.cloud));
        assert!(!frame.inputs.unwrap().exact_images);
    }
}

/// All result files of an experiment without durations, by name.
fn files(folder: &Path, experiment: &str, options: &Options) -> BTreeMap<String, Vec<u8>> {
    let file = folder.join("e.toml");
    fs::write(&file, experiment).unwrap();
    let out = TempDir::new_in(folder).unwrap();
    let options = Options { out: Some(out.path().to_owned()), timed: false, ..options.clone() };
    run(&Plan::read(&file, &[]).unwrap(), &options, &Silent).unwrap();
    let entries = fs::read_dir(out.path()).unwrap().map(|entry| entry.unwrap().path());
    let results = entries.filter(|path| path.extension().is_some_and(|end| end != "json" && end != "lock"));
    results.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap())).collect()
}

/// Trials that share the complete front end and the search, the first half of the front end, or nothing. Trials that
/// navigate share odometry and front end.
const SHARING: &str = "question = 'Does it matter who computes a stage?'\n\
    [source]\nname = 'dive'\nframes = 2\nrate = 5.0\nstart = 30.4\n\
    rig.size = [512, 384]\nrig.focal = 250.0\nwater.attenuation = 0.15\n\
    [[vary]]\nkey = 'trial'\ncases = [\
    { label = 'default', set = {} },\
    { label = 'solver', set = { 'pipeline.solver' = 'kabsch' } },\
    { label = 'locator', set = { 'pipeline.locator' = 'peak' } },\
    { label = 'every frame', set = { navigation = { policy = 'every-frame' } } },\
    { label = 'rarely', set = { navigation = { policy = { name = 'interval', seconds = 9.0 } } } },\
    { label = 'other odometry', set = { navigation = { odometry = { name = 'stereo', window = 1 } } } },\
    { label = 'points', set = { 'pipeline.edges' = 'off' } },\
    { label = 'no corners of edges', set = { 'pipeline.edges' = 'off', 'pipeline.edge-corners.enabled' = false } },\
    ]\n";

/// Searches with random numbers, for several targets in turn: the numbers for a target depend on the one before. Gates
/// are so narrow that some are expanded.
const DRAWING: &str = "question = 'Does it matter who searches?'\nseed = 5\n\
    [source]\nname = 'virtual-points'\nframes = 6\npoints.clutter = 60\n\
    [pipeline]\nsearch = 'ransac'\n\
    [[vary]]\nkey = 'pipeline.solver'\nvalues = ['triad', 'kabsch']\n\
    [[vary]]\nkey = 'pipeline.expand-gates'\nvalues = [false, true]\n\
    [[vary]]\nkey = 'pipeline.gate.chi-square'\nvalues = [0.05, 0.3]\n";

/// Seen to fail when trials with different locators or corners of edges share a front end, and when trials with expanding
/// gates share a search.
#[test]
fn shared_stages_give_the_results_of_each_trial_alone() {
    let folder = TempDir::new().unwrap();
    for experiment in [SHARING, DRAWING] {
        let options = Options { threads: 2, ..Options::into("") };
        let separate = files(folder.path(), experiment, &Options { separate: true, ..options.clone() });
        for threads in [1, 3] {
            let shared = files(folder.path(), experiment, &Options { threads, ..options.clone() });
            assert!(shared.keys().eq(separate.keys()) && shared.len() >= 8, "{:?}", shared.keys());
            shared.iter().for_each(|(name, bytes)| assert!(*bytes == separate[name], "{name} on {threads} threads"));
        }
    }
}

/// A stage that trials share has one duration, marked in each of them; measured separately, none is marked.
#[test]
fn times_of_shared_stages_are_marked() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    fs::write(&file, SHARING).unwrap();
    let plan = Plan::read(&file, &[]).unwrap();
    let times = |separate: bool| -> Vec<Vec<FrameTimes>> {
        let out = TempDir::new_in(folder.path()).unwrap();
        run(&plan, &Options { separate, ..Options::into(out.path()) }, &Silent).unwrap();
        let log = |name: &str| read(&out.path().join(format!("{name}.mcap"))).unwrap();
        let of = |name: &str| log(name).frames.iter().map(|frame| frame.times).collect();
        plan.trials.iter().map(|trial| of(&trial.name)).collect()
    };
    let shared = times(false);
    let marks = |trial: usize| shared[trial].iter().map(|times| times.shared).collect::<Vec<_>>();
    let of = |front_end, search, odometry| SharedStages { front_end, search, odometry };
    assert_eq!([marks(0), marks(1)], [[of(true, true, false); 2], [of(true, true, false); 2]]);
    assert_eq!(marks(2), [of(false, false, false); 2]);
    assert_eq!(marks(3), [of(true, false, true); 2]);
    // A frame without a due fix has no front end.
    assert_eq!(marks(4), [of(true, false, true), of(false, false, true)]);
    assert_eq!(marks(5), [of(true, false, false); 2]);
    for (default, solver) in shared[0].iter().zip(&shared[1]) {
        assert_eq!((default.detect_ms, default.refine_ms), (solver.detect_ms, solver.refine_ms));
    }
    for (one, other) in shared[3].iter().zip(&shared[4]) {
        assert_eq!(one.odometry_ms, other.odometry_ms);
    }
    assert!(times(true).iter().flatten().all(|times| times.shared == SharedStages::default()));
}

/// A stored run has the bytes of a fresh one with the same identity. This holds as a whole and in part. Seen to fail
/// with an identity of the versions alone.
#[test]
fn a_kept_run_is_what_would_be_made_now() {
    let folder = TempDir::new().unwrap();
    let images = "question = 'Why?'\n[source]\nname = 'virtual-images'\nframes = 1\n\
                  rig = { size = [160, 120], focal = 80.0 }\n";
    for (name, text) in [("points", EXPERIMENT), ("images", images)] {
        let file = folder.path().join(format!("{name}.toml"));
        fs::write(&file, text).unwrap();
        let plan = |settings: &[String]| Plan::read(&file, settings).unwrap();
        let made = |out: &str, settings: &[String]| {
            let out = folder.path().join(format!("{name}-{out}"));
            let options = Options { existing: Existing::Keep, timed: false, ..Options::into(&out) };
            let kept = run(&plan(settings), &options, &Silent).unwrap().kept;
            (kept, kept_identity(&out).unwrap(), out)
        };
        let (first, fresh) = (made("a", &[]), made("b", &[]));
        assert!(!first.0 && !fresh.0 && first.1 == fresh.1);
        let again = made("a", &[]);
        assert!(again.0 && again.1 == first.1, "{name}");
        for entry in fs::read_dir(&first.2).unwrap() {
            let path = entry.unwrap().path();
            let other = fresh.2.join(path.file_name().unwrap());
            assert!(fs::read(&path).unwrap() == fs::read(other).unwrap(), "{}", path.display());
        }
        let options = Options { timed: false, ..Options::into(folder.path().join("scratch")) };
        let part = remake(&plan(&[]), &first.2, 1, &options, &Silent).unwrap();
        assert!(part.frames > 0 && part.differing.is_empty(), "{part:?}");
        assert!(!folder.path().join("scratch").exists());
        let other = ["seed=9".to_owned()];
        assert!(remake(&plan(&other), &first.2, 1, &options, &Silent).is_err());
        let changed = made("a", &other);
        assert!(!changed.0 && changed.1 != first.1, "{name}");
    }
}
