//! `seafix dive`.

use std::path::PathBuf;

use clap::Args;
use seafix_experiment::Plan;

use super::export_pairs;
use crate::exit::{Ended, Failure, INPUT, OUTPUT, USAGE};

#[derive(Debug, Args)]
pub(crate) struct Dive {
    /// The experiment file; the dive of its first trial is simulated.
    experiment: PathBuf,
    /// Number of stereo pairs [default: that of the experiment].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.water.attenuation=0.3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The folder of the data set; it must not exist.
    #[arg(long)]
    out: PathBuf,
    /// The licence of the data set.
    #[arg(long, default_value = "MIT OR Apache-2.0")]
    licence: String,
    /// Number of threads; the images do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Dive {
    pub(crate) fn execute(&self) -> Ended {
        let frames = self.frames.map(|frames| format!("source.frames={frames}"));
        let settings: Vec<String> = self.set.iter().cloned().chain(frames).collect();
        let plan = Plan::read(&self.experiment, &settings).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let trial = plan.trials.first().ok_or_else(|| Failure::new(USAGE, "the experiment has no trial"))?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(0, usize::from))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot start threads: {error}")))?;
        pool.install(|| {
            let sequence = trial
                .source
                .open(trial.resolved.seed, &plan.folder)
                .map_err(|faults| Failure::faults(INPUT, &faults))?;
            export_pairs::write(&*sequence, &self.out, &self.licence)
        })
    }
}
