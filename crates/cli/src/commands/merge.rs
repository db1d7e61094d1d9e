//! `seafix merge`.

use std::path::PathBuf;

use clap::Args;
use seafix_experiment::merge;

use super::run::{RunFolder, report_on};
use crate::{
    exit::{DONE, Ended},
    signals,
    terminal::Progress,
};

#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// The folders of all shards of one run, from `seafix run --shard k/n`.
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    #[command(flatten)]
    place: RunFolder,
}

impl Merge {
    pub(crate) fn execute(&self) -> Ended {
        let progress = Progress::new();
        signals::listen();
        let options = self.place.options();
        let finished = merge(&self.shards, &options, &progress);
        signals::end_at_once();
        report_on(&finished?, options.threads)?;
        Ok(DONE)
    }
}
