//! `seafix publish`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use seafix_experiment::{Existing, Options, run};
use seafix_report::{Forms, index, index_holds, report};

use super::report::{failure, verified};
use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, USAGE},
    publication::{self, Published},
    signals,
    terminal::{Progress, print, tell},
};

/// Runs the experiments of a list and reports them into a folder that can be kept beside the program.
#[derive(Debug, Args)]
pub(crate) struct Publish {
    /// The list of experiments (seafix-reports/1).
    #[arg(default_value = "experiments/reports.toml")]
    list: PathBuf,
    /// Where the reports go, a folder each, and README.md, which says what they found.
    #[arg(long, default_value = "reports")]
    out: PathBuf,
    /// Where the runs go, a folder each. Those that are there are gone on with.
    #[arg(long, default_value = "runs/reports")]
    runs: PathBuf,
    /// Of the list only the experiments of these names; README.md is left as it is.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Run nothing: report the runs that are there.
    #[arg(long, conflicts_with_all = ["verify", "overwrite"])]
    logged: bool,
    /// Write nothing: compute every printed number again from the logs of the runs, and say what differs.
    #[arg(long, conflicts_with = "overwrite")]
    verify: bool,
    /// Remove the runs that are there first.
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
        for one in &list {
            if !self.logged {
                self.run(one)?;
            }
            let written =
                report(&self.runs.join(&one.name), &self.out.join(&one.name), Forms::SMALL).map_err(failure)?;
            tell(&format!("{}: {}", one.name, written.page.display()));
        }
        if self.only.is_empty() {
            self.tell_of_others(&list);
            print(&format!("{}\n", index(&self.folders(&list), &self.out).map_err(failure)?.display()))?;
        }
        Ok(DONE)
    }

    /// Makes a run, or what is missing of it, without durations: the same bytes wherever it is made.
    fn run(&self, one: &Published) -> Result<(), Failure> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let options = Options {
            existing: if self.overwrite { Existing::Overwrite } else { Existing::Resume },
            threads: self.threads.map_or(cores, usize::from),
            timed: false,
            ..Options::into(self.runs.join(&one.name))
        };
        let progress = Progress::new();
        signals::listen();
        let finished = run(&one.plan, &options, &progress);
        signals::end_at_once();
        progress.end();
        finished?;
        Ok(())
    }

    fn folders(&self, list: &[Published]) -> Vec<PathBuf> {
        list.iter().map(|one| self.runs.join(&one.name)).collect()
    }

    /// Tells of reports of experiments that are not in the list, and how many. They stay: nobody asked for their removal.
    fn tell_of_others(&self, list: &[Published]) -> usize {
        let Ok(entries) = fs::read_dir(&self.out) else { return 0 };
        let mut others: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        others.retain(|path| is_report(path) && !list.iter().any(|one| path.ends_with(&one.name)));
        others.sort();
        for path in &others {
            let list = self.list.display();
            tell(&format!("{}: a report that is not in {list}: remove it if it is not wanted", path.display()));
        }
        others.len()
    }

    fn verify_all(&self, list: &[Published]) -> Ended {
        let mut holding = 0;
        let mut unreadable: Option<Failure> = None;
        for one in list {
            match verified(&self.runs.join(&one.name), &self.out.join(&one.name)) {
                Ok(holds) => holding += usize::from(holds),
                // The others are verified all the same.
                Err(failure) => {
                    let all = unreadable.get_or_insert(Failure { code: failure.code, lines: Vec::new() });
                    all.lines.extend(failure.lines);
                }
            }
        }
        let mut holds = holding == list.len();
        if self.only.is_empty() {
            holds &= self.tell_of_others(list) == 0;
            if unreadable.is_none() && !index_holds(&self.folders(list), &self.out).map_err(failure)? {
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

/// Whether a folder is a report that this command wrote.
fn is_report(folder: &Path) -> bool {
    folder.join("report.html").exists() && folder.join("summary.txt").exists()
}
