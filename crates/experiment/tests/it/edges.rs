//! Edges as a setting of the pipeline.

use std::{fs, path::Path};

use seafix_experiment::{Options, Plan, Replay, Silent, run};
use seafix_log::{Outcome, TargetRecord, TargetTimes, read};
use tempfile::TempDir;

/// A short dive.
const EXPERIMENT: &str = "question = 'The same?'\nseed = 5\n[source]\nname = 'dive'\nframes = 2\nroute.altitude = 2.5\n\
    rig.size = [512, 384]\nrig.focal = 250.0\n";

/// The short dive with these settings.
fn plan_of(folder: &Path, settings: &[&str]) -> Plan {
    let file = folder.join("e.toml");
    fs::write(&file, EXPERIMENT).unwrap();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    Plan::read(&file, &settings).unwrap()
}

/// The rows of the short dive with these settings, without what only edges have.
fn rows(settings: &[&str]) -> Vec<TargetRecord> {
    let folder = TempDir::new().unwrap();
    let plan = plan_of(folder.path(), settings);
    let out = folder.path().join("run");
    run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let frames = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap().frames;
    let bare = |mut row: TargetRecord| {
        row.times = TargetTimes::default();
        (row.evaluation.edges_visible, row.evaluation.edges_identified) = (None, None);
        row.evaluation.correct_edges = None;
        row
    };
    frames.into_iter().flat_map(|frame| frame.targets).map(bare).collect()
}

/// Law E8: a pipeline without edges gives the same on a site with edges as on one without.
#[test]
fn edges_that_are_off_change_nothing() {
    let off = rows(&["pipeline.edges=off"]);
    assert!(!off.is_empty());
    assert_eq!(off, rows(&["source.model-edges=0.0"]));
    assert_ne!(off, rows(&[]), "edges that are on change something");
}

/// A problem of the twelve edges of a box of 1.2 × 0.8 × 0.5 m, seen from 3 m, without a measured point; one end of an edge
/// is a model point.
fn wireframe() -> String {
    let corner = |c: usize| [0, 1, 2].map(|axis| if c >> axis & 1 == 1 { [1.2, 0.8, 0.5][axis] } else { 0.0 });
    let sides = (0..8).flat_map(|a| [1, 2, 4].map(|step| (a, a | step))).filter(|(a, b)| a != b);
    let sides: Vec<(usize, usize)> = sides.collect();
    let end = |c: usize| if c == 0 { "0".to_owned() } else { format!("{:?}", corner(c)) };
    let edges: Vec<String> = sides.iter().map(|&(a, b)| format!("[{}, {}]", end(a), end(b))).collect();
    let lines: Vec<String> = sides
        .iter()
        .map(|&(a, b)| {
            let at = |t: f64| [0, 1, 2].map(|k| corner(a)[k] + t * (corner(b)[k] - corner(a)[k]) + [0.0, 0.0, 3.0][k]);
            let covariance = "[[1e-6,0,0,0],[0,1e-6,0,0],[0,0,1e-6,0],[0,0,0,1e-6]]";
            format!("{{\"ends\": [{:?}, {:?}], \"covariance\": {covariance}}}", at(0.1), at(0.9))
        })
        .collect();
    format!(
        "{{\"format\": \"coherence-problem/1.1\", \"id\": \"box\", \"model\": [[0,0,0],[1.2,0,0],[0,0.8,0]], \
         \"cloud\": [], \"sigma\": 0.001, \"delta\": 0.01, \"prior\": {{\"T_cam_obj\": \
         [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], \"shell_half_m\": 0.2}}, \"edges\": [{}], \"lines\": [{}]}}",
        edges.join(", "),
        lines.join(", ")
    )
}

/// The row of the only frame of a plan.
fn row(plan: &Plan, out: &Path) -> TargetRecord {
    run(plan, &Options { threads: 1, ..Options::into(out) }, &Silent).unwrap();
    let mut frames = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap().frames;
    let mut row = frames.remove(0).targets.remove(0);
    row.times = TargetTimes::default();
    row
}

/// A problem with edges has a fix in an experiment, the same again from its log, and none without edges.
#[test]
fn edges_of_a_problem_are_used_and_replayed() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("all")).unwrap();
    fs::write(here.join("all/box.json"), wireframe()).unwrap();
    let file = here.join("e.toml");
    let source = "[source]\nname = 'problems'\npath = 'all'\n[pipeline]\nsolver = 'mahalanobis'\n";
    fs::write(&file, format!("question = 'Is the box found?'\n{source}")).unwrap();
    let plan = Plan::read(&file, &[]).unwrap();
    let found = row(&plan, &here.join("run"));
    assert_eq!((found.outcome, found.edges.len(), found.pairs.len()), (Outcome::Fix, 12, 0), "{}", found.explanation);
    let log = here.join(format!("run/{}.mcap", plan.trials[0].name));
    assert_eq!(row(&Replay::default().plan(&log).unwrap(), &here.join("again")), found);
    let off = Plan::read(&file, &["pipeline.edges=off".to_owned()]).unwrap();
    assert_eq!(row(&off, &here.join("off")).outcome, Outcome::Rejected);
}

/// A pipeline without points measures the same edges, identifies no point, and repeats its rows from the log.
///
/// Seen to fail with the points of the cloud kept.
#[test]
fn points_that_are_off_leave_the_edges() {
    let folder = TempDir::new().unwrap();
    let of = |name: &str, settings: &[&str]| {
        let out = folder.path().join(name);
        let plan = plan_of(folder.path(), settings);
        run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
        out.join(format!("{}.mcap", plan.trials[0].name))
    };
    let (alone, both) = (of("alone", &["pipeline.points=off"]), of("both", &[]));
    let again = folder.path().join("again");
    run(&Replay::default().plan(&alone).unwrap(), &Options { threads: 2, ..Options::into(&again) }, &Silent).unwrap();
    let again = read(&again.join(alone.file_name().unwrap())).unwrap().frames;
    let (alone, both) = (read(&alone).unwrap().frames, read(&both).unwrap().frames);
    let mut fixes = 0;
    for ((alone, both), again) in alone.iter().zip(&both).zip(&again) {
        assert!(alone.cloud.is_empty() && !both.cloud.is_empty());
        assert_eq!(alone.lines, both.lines);
        for (row, again) in alone.targets.iter().zip(&again.targets) {
            assert!(row.pairs.is_empty() && row.candidates.iter().all(Vec::is_empty));
            assert_eq!((row.outcome, &row.edges), (again.outcome, &again.edges));
            fixes += usize::from(row.outcome == Outcome::Fix && row.edges.len() > 2);
        }
    }
    assert!(fixes > 0);
}

/// Attempts by edges alone depend on the prior, not on the images: water without sight has as many as clear water.
///
/// Seen to fail where an attempt needs a measured line.
#[test]
fn attempts_by_edges_alone_do_not_depend_on_the_water() {
    let names = |settings: &[&str]| -> Vec<String> {
        let rows = rows(&[settings, &["pipeline.points=off"]].concat());
        rows.into_iter().map(|row| row.object).filter(|object| !object.is_empty()).collect()
    };
    let clear = names(&[]);
    assert!(!clear.is_empty());
    assert_eq!(names(&["source.water.attenuation=4.0"]), clear);
}

/// Attempts that the model decides are the same for points, edges and both, in clear water and in water without sight.
///
/// Seen to fail with the rule of the identified features.
#[test]
fn attempts_by_the_model_are_the_same_for_all_features() {
    let names = |settings: &[&str]| -> Vec<String> {
        let rows = rows(&[settings, &["pipeline.attempts=model"]].concat());
        rows.into_iter().map(|row| row.object).filter(|object| !object.is_empty()).collect()
    };
    let both = names(&[]);
    assert!(!both.is_empty());
    let features = ["pipeline.points=off", "pipeline.edges=off", "pipeline.points=on"];
    for settings in features.iter().flat_map(|one| [vec![*one], vec![*one, "source.water.attenuation=4.0"]]) {
        assert_eq!(names(&settings), both, "{settings:?}");
    }
}

/// A pipeline that could identify nothing is refused.
///
/// Seen to fail without each of the checks.
#[test]
fn points_are_not_switched_off_without_edges() {
    let folder = TempDir::new().unwrap();
    let rejected = |setting: &str| {
        let settings = ["pipeline.points=off".to_owned(), setting.to_owned()];
        fs::write(folder.path().join("e.toml"), EXPERIMENT).unwrap();
        let faults = Plan::read(&folder.path().join("e.toml"), &settings).unwrap_err();
        faults.iter().map(|fault| fault.to_string() + "\n").collect::<String>()
    };
    assert!(rejected("pipeline.edges=off").contains("switch one of them on"), "{}", rejected("pipeline.edges=off"));
    assert!(rejected("pipeline.solver=kabsch").contains("the solver `kabsch` takes no edges"));
    assert!(rejected("pipeline.search=icp").contains("the search `icp` takes no edges"));
}
