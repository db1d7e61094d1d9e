//! The cost comment at the head of every experiment in `experiments/`.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use seafix_experiment::{Plan, Trial};

/// All experiment files below `folder`, without the list of reports.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|end| end == "toml") && !path.ends_with("reports.toml") {
            found.push(path);
        }
    }
}

/// The key of a source's frame count: all of its settings, or only those outside of tables, which affect appearance
/// only.
/// outside of tables.
fn key(trial: &Trial, full: bool) -> String {
    let mut source = trial.resolved.source.clone();
    if !full {
        source.settings.retain(|_, value| !value.is_table());
        return format!("{source:?}");
    }
    format!("{source:?} {}", trial.resolved.seed)
}

/// The number of trials and of frames over all of them. Every source is opened, or one of those that differ in tables
/// only.
fn counted(plan: &Plan, full: bool) -> (usize, usize) {
    // Trials of one source share its frames.
    let mut frames: BTreeMap<String, usize> = BTreeMap::new();
    let of = |trial: &Trial| {
        *frames.entry(key(trial, full)).or_insert_with(|| {
            let sequence = trial.source.open(trial.resolved.seed, &plan.folder);
            sequence.map(|sequence| sequence.frames()).unwrap_or_else(|faults| panic!("{faults:?}"))
        })
    };
    (plan.trials.len(), plan.trials.iter().map(of).sum())
}

/// The form of the comment is `# Cost: 7 trials, 420 frames; 5 min of one core (an EPYC, other work beside), 1.3 GB of
/// log; estimated.` in one line. Time and disk space are measured, or estimated by `--dry-run`. The test repeats the
/// counts.
/// and disk as measured, or as `--dry-run` estimates them. What can be counted is counted again.
fn stated(full: bool) {
    let mut all = Vec::new();
    files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments"), &mut all);
    assert!(all.len() > 20, "{} experiments", all.len());
    let mut wrong = Vec::new();
    for file in all {
        let text = fs::read_to_string(&file).unwrap();
        let costs: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("# Cost: ")).collect();
        let (trials, frames) = counted(&Plan::read(&file, &[]).unwrap(), full);
        let plural = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let counts = format!("{}, {}; ", plural(trials, "trial"), plural(frames, "frame"));
        let states = |cost: &&str| {
            let rest = cost.strip_prefix(&counts)?;
            let (spent, how) = rest.strip_suffix('.')?.split_once("; ")?;
            let units = [" s of one core (", " min of one core (", " h of one core ("];
            let timed = units.iter().any(|unit| spent.contains(unit));
            let stored = spent.ends_with("MB of log") || spent.ends_with("GB of log");
            (timed && stored && ["measured", "estimated", "time measured, log estimated"].contains(&how)).then_some(())
        };
        if costs.len() != 1 || states(&costs[0]).is_none() {
            wrong.push(format!("{}: {counts}… against {costs:?}", file.display()));
        }
    }
    assert!(wrong.is_empty(), "no cost, or another one:\n{}", wrong.join("\n"));
}

#[test]
fn every_experiment_states_its_cost() {
    stated(false);
}

#[test]
#[ignore = "long: every source of every experiment is opened"]
fn every_experiment_states_its_cost_over_all_its_sources() {
    stated(true);
}
