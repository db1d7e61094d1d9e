//! `seafix publish`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use rayon::prelude::*;
use seafix_component::counted;
use seafix_experiment::{Existing, Options, Remade, RunError, kept_identity, remake, run};
use seafix_report::{Forms, Prepared, Report, claim_index, index, index_holds, prepare, update_index, verify_answered};

use super::report::{failure, verified};
use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, USAGE},
    publication::{self, Published},
    signals,
    terminal::{Progress, notify, print},
};

/// Runs the experiments of a list and writes their reports into a folder of the repository. Runs are kept; a run is
/// repeated only if its results may have changed: by its configuration, inputs, or the version of a component.
#[derive(Debug, Args)]
pub(crate) struct Publish {
    /// The list of experiments (seafix-reports/1).
    #[arg(default_value = "experiments/reports.toml")]
    list: PathBuf,
    /// The folder of the reports, one folder each, and of README.md with their findings.
    #[arg(long, default_value = "reports")]
    out: PathBuf,
    /// The folder of the kept runs, one folder each.
    #[arg(long, default_value = "runs/reports")]
    runs: PathBuf,
    /// Publish only the experiments of these names; the rest of README.md stays.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Write nothing: compute every printed number again from the logs of the kept runs, and list differences.
    #[arg(long, conflicts_with_all = ["overwrite", "check"])]
    verify: bool,
    /// Write nothing: repeat a part of N kept runs, at most 8 frames of each, and list differences.
    #[arg(long, value_name = "N", conflicts_with = "overwrite")]
    check: Option<usize>,
    /// Remove all kept runs and repeat them.
    #[arg(long)]
    overwrite: bool,
    /// Number of threads; results do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Publish {
    pub(crate) fn execute(&self) -> Ended {
        let mut list = publication::read(&self.list).map_err(|faults| Failure::faults(USAGE, &faults))?;
        if let Some(unknown) = self.only.iter().find(|name| !list.iter().any(|one| one.name == **name)) {
            let names: Vec<&str> = list.iter().map(|one| one.name.as_str()).collect();
            let what = format!("no experiment `{unknown}` in {}; it has {}", self.list.display(), names.join(", "));
            return Err(Failure::new(USAGE, what));
        }
        list.retain(|one| self.only.is_empty() || self.only.contains(&one.name));
        if self.verify {
            return self.verify_all(&list);
        }
        if let Some(count) = self.check {
            return self.check_some(&list, count);
        }
        if self.only.is_empty() {
            claim_index(&self.out).map_err(failure)?;
        }
        for one in &list {
            let how = if self.run(one)? { "kept run" } else { "new run" };
            notify(&format!("{}: {how}", one.name));
        }
        let Some(prepared) = self.prepare(&list)? else { return Ok(FINDINGS) };
        let written = list.iter().zip(prepared).map(|(one, report)| report.write(&self.out.join(&one.name)));
        let written: Vec<Report> = written.collect::<Result<_, _>>().map_err(failure)?;
        written.iter().for_each(|report| notify(&format!("report: {}", report.page.display())));
        let findings = written.iter().map(|report| report.findings.as_str());
        if self.only.is_empty() {
            self.distinguish_others(&list);
            let page = index(findings, &self.out).map_err(failure)?;
            print(&format!("{}\n", page.display()))?;
        } else {
            for name in update_index(findings, &self.out).map_err(failure)? {
                notify(&format!("{name}: no section in README.md; a complete publication adds it"));
            }
        }
        Ok(DONE)
    }

    /// Makes all reports before any is written; `None` if a claim does not hold, which is printed.
    fn prepare(&self, list: &[Published]) -> Result<Option<Vec<Prepared>>, Failure> {
        let one = |one: &Published| prepare(&self.runs.join(&one.name), Forms::SMALL, one.answer.as_ref());
        let made: Vec<_> = list.par_iter().map(one).collect();
        let (mut prepared, mut faulty): (Vec<Prepared>, Option<Failure>) = (Vec::new(), None);
        for report in made {
            match report.map_err(failure) {
                Ok(report) => prepared.push(report),
                Err(failure) => {
                    faulty.get_or_insert(Failure { code: failure.code, lines: Vec::new() }).lines.extend(failure.lines);
                }
            }
        }
        if let Some(failure) = faulty {
            return Err(failure);
        }
        let unmet: String = list
            .iter()
            .zip(&prepared)
            .flat_map(|(one, report)| report.unmet.iter().map(|line| format!("{}: {line}\n", one.name)))
            .collect();
        print(&unmet)?;
        Ok(unmet.is_empty().then_some(prepared))
    }

    /// The options of a run without durations: it has the same bytes on every machine.
    fn options(&self, folder: PathBuf) -> Options {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Options { threads: self.threads.map_or(cores, usize::from), timed: false, ..Options::into(folder) }
    }

    /// Makes a run unless a kept run has its identity; the result states whether one was kept.
    fn run(&self, one: &Published) -> Result<bool, Failure> {
        let existing = if self.overwrite { Existing::Overwrite } else { Existing::Keep };
        let options = Options { existing, ..self.options(self.runs.join(&one.name)) };
        Ok(watched(|progress| run(&one.plan, &options, progress))?.kept)
    }

    /// Repeats a part of some kept runs.
    fn check_some(&self, list: &[Published], count: usize) -> Ended {
        // Sorted by identity: the sample changes whenever a run changes, and only then.
        let kept = |one: &'_ Published| kept_identity(&self.runs.join(&one.name));
        let mut sample: Vec<(String, &Published)> = list.iter().filter_map(|one| Some((kept(one)?, one))).collect();
        sample.sort_by(|a, b| a.0.cmp(&b.0));
        sample.truncate(count);
        let mut same = 0;
        for (_, one) in &sample {
            let folder = self.runs.join(&one.name);
            let options = self.options(self.runs.join(format!(".check-{}", std::process::id())));
            let Remade { frames, differing } =
                watched(|progress| remake(&one.plan, &folder, CHECKED, &options, progress))?;
            same += usize::from(differing.is_empty());
            let message = if differing.is_empty() { "the same" } else { "not the same" };
            print(&format!("{}: {} repeated, {message}\n", one.name, counted(frames, "frame")))?;
            for what in differing {
                print(&format!("{}: {what} differ; raise the VERSION of the changed component\n", one.name))?;
            }
        }
        print(&format!("{same} of {} kept runs equal a new run\n", sample.len()))?;
        Ok(if same == sample.len() { DONE } else { FINDINGS })
    }

    /// Lists the reports of experiments that are not in the list, and counts them. They are not removed.
    fn distinguish_others(&self, list: &[Published]) -> usize {
        let Ok(entries) = fs::read_dir(&self.out) else { return 0 };
        let mut others: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        others.retain(|path| is_report(path) && !list.iter().any(|one| path.ends_with(&one.name)));
        others.sort();
        for path in &others {
            let list = self.list.display();
            notify(&format!("{}: report of no experiment in {list}; remove it if it is not needed", path.display()));
        }
        others.len()
    }

    fn verify_all(&self, list: &[Published]) -> Ended {
        let (mut holding, mut findings) = (0, Vec::new());
        let mut unreadable: Option<Failure> = None;
        for one in list {
            let (run, folder) = (self.runs.join(&one.name), self.out.join(&one.name));
            match verified(&run, &folder, |run, folder| verify_answered(run, folder, one.answer.as_ref())) {
                Ok((holds, section)) => {
                    holding += usize::from(holds);
                    findings.push(section);
                }
                // The others are verified nevertheless.
                Err(failure) => {
                    let all = unreadable.get_or_insert(Failure { code: failure.code, lines: Vec::new() });
                    all.lines.extend(failure.lines);
                }
            }
        }
        let mut holds = holding == list.len();
        if self.only.is_empty() {
            holds &= self.distinguish_others(list) == 0;
            if unreadable.is_none() && !index_holds(findings.iter().map(String::as_str), &self.out) {
                print(&format!("{} differs from the logs\n", self.out.join("README.md").display()))?;
                holds = false;
            }
        }
        print(&format!("{holding} of {} reports agree with their logs\n", list.len()))?;
        match unreadable {
            Some(failure) => Err(failure),
            None => Ok(if holds { DONE } else { FINDINGS }),
        }
    }
}

/// Maximum number of frames of a trial that a check repeats.
const CHECKED: usize = 8;

/// Runs `work` with progress and signal handling.
fn watched<T>(work: impl FnOnce(&Progress) -> Result<T, RunError>) -> Result<T, Failure> {
    let progress = Progress::new();
    signals::listen();
    let done = work(&progress);
    signals::end_at_once();
    progress.end();
    Ok(done?)
}

/// Whether a folder holds a report of this command.
fn is_report(folder: &Path) -> bool {
    folder.join("report.html").exists() && folder.join("summary.txt").exists()
}
