//! `seafix publish`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use rayon::prelude::*;
use seafix_component::counted;
use seafix_experiment::{Existing, Options, Remade, RunError, kept_identity, remake, run};
use seafix_report::{Forms, Report, index, index_holds, report};

use super::report::{failure, verified};
use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, USAGE},
    publication::{self, Published},
    signals,
    terminal::{Progress, notify, print},
};

/// Runs the experiments of a list and reports them into a folder that can be kept beside the program. A run is kept, and made
/// again only when something changes that its results depend on: configuration, inputs, the version of a component.
#[derive(Debug, Args)]
pub(crate) struct Publish {
    /// The list of experiments (seafix-reports/1).
    #[arg(default_value = "experiments/reports.toml")]
    list: PathBuf,
    /// Where the reports go, a folder each, and README.md, which says what they found.
    #[arg(long, default_value = "reports")]
    out: PathBuf,
    /// Where the runs are kept, a folder each. A run whose results would change is made again in its place.
    #[arg(long, default_value = "runs/reports")]
    runs: PathBuf,
    /// Of the list only the experiments of these names; README.md is left as it is.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Write nothing: compute every printed number again from the logs of the kept runs, and say what differs.
    #[arg(long, conflicts_with_all = ["overwrite", "check"])]
    verify: bool,
    /// Write nothing: make a part of this many kept runs again, at most 8 frames of each, and say what differs.
    #[arg(long, value_name = "N", conflicts_with = "overwrite")]
    check: Option<usize>,
    /// Use no kept run: remove those that are there, and make all again.
    #[arg(long)]
    overwrite: bool,
    /// How many threads work; the answers do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Publish {
    pub(crate) fn execute(&self) -> Ended {
        let mut list = publication::read(&self.list).map_err(|faults| Failure::faults(USAGE, &faults))?;
        if let Some(unknown) = self.only.iter().find(|name| !list.iter().any(|one| one.name == **name)) {
            let names: Vec<&str> = list.iter().map(|one| one.name.as_str()).collect();
            let what = format!("`{unknown}` is not in {}; there are {}", self.list.display(), names.join(", "));
            return Err(Failure::new(USAGE, what));
        }
        list.retain(|one| self.only.is_empty() || self.only.contains(&one.name));
        if self.verify {
            return self.verify_all(&list);
        }
        if let Some(count) = self.check {
            return self.check_some(&list, count);
        }
        for one in &list {
            let how = if self.run(one)? { "kept run" } else { "new run" };
            notify(&format!("{}: {how}", one.name));
        }
        let written = |one: &Published| report(&self.runs.join(&one.name), &self.out.join(&one.name), Forms::SMALL);
        let written: Vec<_> = list.par_iter().map(written).collect();
        let written: Vec<Report> = written.into_iter().collect::<Result<_, _>>().map_err(failure)?;
        written.iter().for_each(|report| notify(&format!("report: {}", report.page.display())));
        if self.only.is_empty() {
            self.distinguish_others(&list);
            let page = index(written.iter().map(|report| report.findings.as_str()), &self.out).map_err(failure)?;
            print(&format!("{}\n", page.display()))?;
        }
        Ok(DONE)
    }

    /// A run without durations: the same bytes wherever it is made.
    fn options(&self, folder: PathBuf) -> Options {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Options { threads: self.threads.map_or(cores, usize::from), timed: false, ..Options::into(folder) }
    }

    /// Makes a run, where none that is kept has its results; whether one was kept.
    fn run(&self, one: &Published) -> Result<bool, Failure> {
        let existing = if self.overwrite { Existing::Overwrite } else { Existing::Keep };
        let options = Options { existing, ..self.options(self.runs.join(&one.name)) };
        Ok(watched(|progress| run(&one.plan, &options, progress))?.kept)
    }

    /// Makes a part of some kept runs again.
    fn check_some(&self, list: &[Published], count: usize) -> Ended {
        // By their identities: another sample whenever a run changes, the same until then.
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
            let said = if differing.is_empty() { "the same" } else { "not the same" };
            print(&format!("{}: {} made again, {said}\n", one.name, counted(frames, "frame")))?;
            for what in differing {
                print(&format!("{}: {what} differ; raise the VERSION of what changed\n", one.name))?;
            }
        }
        print(&format!("{same} of {} kept runs are what would be made now\n", sample.len()))?;
        Ok(if same == sample.len() { DONE } else { FINDINGS })
    }

    /// Tells of reports of experiments that are not in the list, and how many. They stay: nobody asked for their removal.
    fn distinguish_others(&self, list: &[Published]) -> usize {
        let Ok(entries) = fs::read_dir(&self.out) else { return 0 };
        let mut others: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        others.retain(|path| is_report(path) && !list.iter().any(|one| path.ends_with(&one.name)));
        others.sort();
        for path in &others {
            let list = self.list.display();
            notify(&format!("{}: a report that is not in {list}: remove it if it is not wanted", path.display()));
        }
        others.len()
    }

    fn verify_all(&self, list: &[Published]) -> Ended {
        let (mut holding, mut findings) = (0, Vec::new());
        let mut unreadable: Option<Failure> = None;
        for one in list {
            match verified(&self.runs.join(&one.name), &self.out.join(&one.name)) {
                Ok((holds, section)) => {
                    holding += usize::from(holds);
                    findings.push(section);
                }
                // The others are verified all the same.
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
                print(&format!("{} is not what the logs make\n", self.out.join("README.md").display()))?;
                holds = false;
            }
        }
        print(&format!("{holding} of {} reports are what their logs make\n", list.len()))?;
        match unreadable {
            Some(failure) => Err(failure),
            None => Ok(if holds { DONE } else { FINDINGS }),
        }
    }
}

/// Frames of a kept run, for each trial, that a check makes again at most.
const CHECKED: usize = 8;

/// Does work that a person watches and may end.
fn watched<T>(work: impl FnOnce(&Progress) -> Result<T, RunError>) -> Result<T, Failure> {
    let progress = Progress::new();
    signals::listen();
    let done = work(&progress);
    signals::end_at_once();
    progress.end();
    Ok(done?)
}

/// Whether a folder is a report that this command wrote.
fn is_report(folder: &Path) -> bool {
    folder.join("report.html").exists() && folder.join("summary.txt").exists()
}
