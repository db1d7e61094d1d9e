//! Edges as a setting of the pipeline.

use std::fs;

use seafix_experiment::{Options, Plan, Silent, run};
use seafix_log::{TargetRecord, TargetTimes, read};
use tempfile::TempDir;

/// The rows of a short dive with these settings, without what only edges have.
fn rows(settings: &[&str]) -> Vec<TargetRecord> {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    let source =
        "[source]\nname = 'dive'\nframes = 2\nroute.altitude = 2.5\nrig.size = [512, 384]\nrig.focal = 250.0\n";
    fs::write(&file, format!("question = 'The same?'\nseed = 5\n{source}")).unwrap();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let plan = Plan::read(&file, &settings).unwrap();
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
