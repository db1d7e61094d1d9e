//! `seafix replay`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use seafix_experiment::{Options, Replay, ReplayFrom, run};

use super::run::{RunFolder, report_on};
use crate::{
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    signals,
    terminal::Progress,
};

#[derive(Debug, Args)]
pub(crate) struct Replayed {
    /// The log of a trial.
    log: PathBuf,
    /// A search in place of the logged one; every further --search adds a trial.
    #[arg(long, value_name = "NAME")]
    search: Vec<String>,
    /// A solver in place of the logged one; every further --solver adds a trial.
    #[arg(long, value_name = "NAME")]
    solver: Vec<String>,
    /// Change another setting: a dotted key and a TOML value, `pipeline.gate={chi-square=0.999}`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Start from the logged clouds or images [default: clouds, unless an earlier stage is changed].
    #[arg(long)]
    from: Option<From>,
    #[command(flatten)]
    place: RunFolder,
    /// Log no durations; two runs of one replay then have the same bytes.
    #[arg(long)]
    untimed: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum From {
    Clouds,
    Images,
}

impl Replayed {
    pub(crate) fn execute(&self) -> Ended {
        let replay = Replay {
            searches: self.search.clone(),
            solvers: self.solver.clone(),
            settings: self.set.clone(),
            from: match self.from {
                None => ReplayFrom::Suited,
                Some(From::Clouds) => ReplayFrom::Clouds,
                Some(From::Images) => ReplayFrom::Images,
            },
        };
        let plan = replay.plan(&self.log).map_err(|faults| {
            let log = faults.iter().any(|fault| fault.file == self.log && fault.line.is_none());
            Failure::faults(if log { INPUT } else { USAGE }, &faults)
        })?;
        let options = Options { timed: !self.untimed, ..self.place.options() };
        let progress = Progress::new();
        signals::listen();
        let finished = run(&plan, &options, &progress);
        signals::end_at_once();
        progress.end();
        report_on(&finished?, options.threads)?;
        Ok(DONE)
    }
}
