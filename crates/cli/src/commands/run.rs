//! `seafix run`.

use std::path::PathBuf;

use clap::Args;
use seafix_experiment::{Plan, run};
use seafix_report::report;

use crate::{
    exit::{DONE, Ended, Failure, USAGE},
    terminal::{Progress, print},
};

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// An experiment file, or the folder of a data set for the default pipeline.
    experiment: PathBuf,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.frames=3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The folder of the run; it must not exist or be empty [default: the next free one below runs/].
    #[arg(long)]
    out: Option<PathBuf>,
    /// How many threads work; the answers do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Run {
    pub(crate) fn execute(&self) -> Ended {
        let plan = Plan::read(&self.experiment, &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = self.threads.map_or(cores, usize::from);
        let progress = Progress::new();
        let finished = run(&plan, self.out.as_deref(), threads, &progress);
        progress.end();
        let finished = finished?;
        let written = report(&finished.folder, &finished.folder.join("report")).map_err(super::report::failure)?;
        print(&format!("{}\nreport: {}\n", written.summary, written.page.display()))?;
        Ok(DONE)
    }
}
