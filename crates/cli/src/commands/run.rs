//! `seafix run`.

use std::path::PathBuf;

use clap::Args;
use rayon::ThreadPoolBuilder;
use seafix_experiment::{Existing, Options, Plan, RunEstimate, Shard, estimate, run};
use seafix_report::{Forms, report};

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT, USAGE},
    signals,
    terminal::{Progress, print},
};

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// An experiment file, or the folder of a data set for the default pipeline.
    experiment: PathBuf,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.frames=3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    place: RunFolder,
    /// Make only the k-th of n parts of the run; `seafix merge` joins them.
    #[arg(long, value_name = "K/N", requires = "out")]
    shard: Option<Shard>,
    /// Say what it would take, by trying frames of every source for some seconds, and keep nothing.
    #[arg(long, conflicts_with_all = ["out", "shard"])]
    dry_run: bool,
    /// Log no durations: two runs of one experiment then have the same bytes.
    #[arg(long)]
    untimed: bool,
    /// Let every trial compute all of its stages itself, so that its durations are its own; without it, trials with equal
    /// stages share them.
    #[arg(long)]
    separate: bool,
}

/// Where a run goes, and who works on it.
#[derive(Debug, Args)]
pub(crate) struct RunFolder {
    /// The folder of the run; it must not exist or be empty [default: the next free one below runs/].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Go on with the run that is in the folder, if it is the same one; begin it if there is none. Of a run that was killed the
    /// pieces that were in work are made again: at most 8 frames a thread with images, 8192 without; where a trial navigates,
    /// all frames of its source.
    #[arg(long, requires = "out", conflicts_with = "overwrite")]
    resume: bool,
    /// Remove the run that is in the folder first.
    #[arg(long, requires = "out")]
    overwrite: bool,
    /// How many threads work; the answers do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl RunFolder {
    pub(crate) fn options(&self) -> Options {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let existing = match (self.resume, self.overwrite) {
            (true, _) => Existing::Resume,
            (_, true) => Existing::Overwrite,
            _ => Existing::Refuse,
        };
        let threads = self.threads.map_or(cores, usize::from);
        Options { out: self.out.clone(), existing, threads, shard: None, timed: true, separate: false }
    }
}

impl Run {
    pub(crate) fn execute(&self) -> Ended {
        let plan = Plan::read(&self.experiment, &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        if self.dry_run {
            return print(&reported(&plan, &estimate(&plan, self.separate)?, self.place.options().threads))
                .map(|()| DONE);
        }
        let own = self.place.options();
        let options = Options { shard: self.shard, timed: !self.untimed, separate: self.separate, ..own };
        let progress = Progress::new();
        signals::listen();
        let finished = run(&plan, &options, &progress);
        signals::end_at_once();
        progress.end();
        let finished = finished?;
        match self.shard {
            Some(shard) => print(&format!("shard {shard}: {}\n", finished.folder.display()))?,
            None => report_on(&finished, options.threads)?,
        }
        Ok(DONE)
    }
}

/// Trials, frames, disk and time, in words.
fn reported(plan: &Plan, estimate: &RunEstimate, threads: usize) -> String {
    let lines = plan.trials.iter().zip(&estimate.frames);
    let mut text: String = lines.map(|(trial, frames)| format!("{:60} {frames:>9} frames\n", trial.name)).collect();
    let frames: usize = estimate.frames.iter().sum();
    text += &format!(
        "{} trials, {frames} frames, about {} MB (twice that while it is joined), about {} on {threads} threads\n",
        plan.trials.len(),
        estimate.bytes.div_ceil(1_000_000),
        duration(estimate.on(threads).as_secs_f64()),
    );
    let build = if cfg!(debug_assertions) { ", a build with assertions" } else { "" };
    text + &format!(
        "by {} frames, tried on one thread in {:.1} s, this machine as busy as it is{build}; cores are not always whole ones\n",
        estimate.tried,
        estimate.spent.as_secs_f64()
    )
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Makes the report of a run that is complete on so many threads, and prints its summary.
pub(crate) fn report_on(finished: &seafix_experiment::Finished, threads: usize) -> Result<(), Failure> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Failure::new(OUTPUT, format!("no threads ({error}): {threads}")))?;
    let written = pool.install(|| report(&finished.folder, &finished.folder.join("report"), Forms::ALL));
    let written = written.map_err(super::report::failure)?;
    print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))
}
