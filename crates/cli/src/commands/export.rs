//! `seafix export`.

use std::path::PathBuf;

use clap::Args;
use seafix_experiment::Plan;

use super::export_pairs;
use crate::exit::{Ended, Failure, INPUT, USAGE};

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The experiment file; the source of its first trial is written.
    experiment: PathBuf,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.frames=3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The folder of the data set; it must not exist.
    #[arg(long)]
    out: PathBuf,
    /// The licence of the data set.
    #[arg(long, default_value = "MIT OR Apache-2.0")]
    licence: String,
}

impl Export {
    pub(crate) fn execute(&self) -> Ended {
        let plan = Plan::read(&self.experiment, &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let trial = plan.trials.first().ok_or_else(|| Failure::new(USAGE, "the experiment has no trial"))?;
        let sequence =
            trial.source.open(trial.resolved.seed, &plan.folder).map_err(|faults| Failure::faults(INPUT, &faults))?;
        export_pairs::write(&*sequence, &self.out, &self.licence)
    }
}
