//! `seafix recover`.

use std::path::PathBuf;

use clap::Args;
use seafix_log::{LogError, recover};

use crate::{
    exit::{DONE, Ended, Failure, INPUT, OUTPUT},
    terminal::{print, tell},
};

#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// The log: cut off, damaged, or left as `.partial` by a run that was killed.
    log: PathBuf,
    /// The file to write [default: NAME-recovered.mcap beside it].
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Recover {
    pub(crate) fn execute(&self) -> Ended {
        let out = self.out.clone().unwrap_or_else(|| {
            let name = self.log.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            let name = name.trim_end_matches(".partial").trim_end_matches(".mcap");
            self.log.with_file_name(format!("{name}-recovered.mcap"))
        });
        if out.exists() {
            return Err(Failure::new(OUTPUT, format!("{} exists; name another file with --out", out.display())));
        }
        let found = recover(&self.log, &out).map_err(|error| {
            let written = matches!(&error, LogError::Write { .. })
                || matches!(&error, LogError::Io { doing, .. } if *doing != "read");
            Failure::new(if written { OUTPUT } else { INPUT }, error)
        })?;
        for lost in &found.lost {
            tell(&format!("lost: {lost} in {}", self.log.display()));
        }
        print(&format!(
            "{}: {} messages, {} whole frames, up to stamp {} ns; {} messages of torn frames left out\n",
            out.display(),
            found.messages,
            found.frames,
            found.last_ns,
            found.dropped
        ))?;
        Ok(DONE)
    }
}
