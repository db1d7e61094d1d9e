//! `seafix run`.

use std::path::PathBuf;

use clap::Args;
use rayon::ThreadPoolBuilder;
use seafix_experiment::{Existing, Options, Plan, RunEstimate, Shard, estimate, run};
use seafix_report::{Forms, report};

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT, USAGE},
    signals,
    terminal::{Progress, notify, print},
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
    /// Run shard k of n only; `seafix merge` merges all shards.
    #[arg(long, value_name = "K/N", requires = "out")]
    shard: Option<Shard>,
    /// Estimate frames, disk and time from frames of every source, processed for some seconds; keep nothing.
    #[arg(long, conflicts_with_all = ["out", "shard"])]
    dry_run: bool,
    /// Log no durations; two runs of one experiment then have the same bytes.
    #[arg(long)]
    untimed: bool,
    /// Compute all stages in every trial, so that durations are those of the trial alone; by default trials with equal
    /// stages share them.
    #[arg(long)]
    separate: bool,
}

/// The folder of a run, and its number of threads.
#[derive(Debug, Args)]
pub(crate) struct RunFolder {
    /// The folder of the run, new or empty [default: the next free one below runs/].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Resume the run of the folder if it is the same run; start it if there is none. Pieces that a killed run had not
    /// completed are repeated: at most 8 frames a thread with images, 8192 without, and all frames of a source with
    /// navigation.
    #[arg(long, requires = "out", conflicts_with = "overwrite")]
    resume: bool,
    /// Remove the run in the folder first.
    #[arg(long, requires = "out")]
    overwrite: bool,
    /// Number of threads; results do not depend on it [default: all cores].
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

/// The estimate of a dry run as text: trials, frames, disk and time.
fn reported(plan: &Plan, estimate: &RunEstimate, threads: usize) -> String {
    let lines = plan.trials.iter().zip(&estimate.frames);
    let mut text: String = lines.map(|(trial, frames)| format!("{:60} {frames:>9} frames\n", trial.name)).collect();
    let frames: usize = estimate.frames.iter().sum();
    text += &format!(
        "{} trials, {frames} frames, about {} MB (twice that while pieces are joined), about {} on {threads} threads\n",
        plan.trials.len(),
        estimate.bytes.div_ceil(1_000_000),
        duration(estimate.on(threads).as_secs_f64()),
    );
    let build = if cfg!(debug_assertions) { ", built with assertions" } else { "" };
    text + &format!(
        "estimated from {} frames on one thread in {:.1} s, at the current load{build}; cores may share hardware\n",
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

/// Makes the report of a finished run on a number of threads, and prints its summary.
pub(crate) fn report_on(finished: &seafix_experiment::Finished, threads: usize) -> Result<(), Failure> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Failure::new(OUTPUT, format!("cannot start {threads} threads: {error}")))?;
    let written = pool.install(|| report(&finished.folder, &finished.folder.join("report"), Forms::ALL));
    let written = written.map_err(super::report::failure)?;
    print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))?;
    if let Some(warning) = written.scale_warning {
        notify(&format!("warning: {warning}"));
    }
    Ok(())
}
