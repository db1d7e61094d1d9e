//! `seafix compare`.

use std::path::PathBuf;

use clap::Args;
use seafix_report::compare;

use super::report::failure;
use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, USAGE},
    terminal::{print, width},
};

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The folders of two or more runs.
    #[arg(required = true, num_args = 2..)]
    runs: Vec<PathBuf>,
    /// Compare runs of different data too.
    #[arg(long)]
    force: bool,
    /// Write the comparison as a page, compare.html, into this folder.
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Compare {
    pub(crate) fn execute(&self) -> Ended {
        for (index, run) in self.runs.iter().enumerate() {
            if self.runs[..index].contains(run) {
                return Err(Failure::new(USAGE, format!("{} is given twice; name different runs", run.display())));
            }
        }
        let compared = compare(&self.runs, self.force, self.out.as_deref(), Some(width())).map_err(failure)?;
        print(&compared.table)?;
        if let Some(page) = &compared.page {
            print(&format!("page: {}\n", page.display()))?;
        }
        Ok(if compared.differ { FINDINGS } else { DONE })
    }
}
