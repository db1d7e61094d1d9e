//! `seafix view`.

use std::{
    io::{ErrorKind, Write as _},
    path::PathBuf,
    process::Command,
};

use clap::Args;
use seafix_component::Fault;
use seafix_log::Reader;

use crate::exit::{DONE, Ended, Failure, INPUT, OUTPUT};

/// The blueprint of Rerun that `docs/viewers/blueprint.py` writes.
const BLUEPRINT: &[u8] = include_bytes!("../../../../docs/viewers/seafix.rbl");

/// Opens a log in Rerun, with images, clouds and the site side by side.
#[derive(Debug, Args)]
pub(crate) struct View {
    /// The log of a trial, an .mcap file.
    log: PathBuf,
}

impl View {
    pub(crate) fn execute(&self) -> Ended {
        let input = |fault: Fault| Failure::new(INPUT, fault);
        if self.log.is_dir() {
            let fault = Fault::new("a folder, not the log of a trial", &self.log);
            return Err(input(fault.remedy("name one of its .mcap files")));
        }
        Reader::open(&self.log).map_err(|error| Failure::new(INPUT, error))?;
        let blueprint = Blueprint::write()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot write a temporary blueprint: {error}")))?;
        let started = Command::new("rerun").arg(&self.log).arg(&blueprint.0).status();
        match started {
            Ok(status) if status.success() => Ok(DONE),
            Ok(status) => {
                Err(Failure::new(OUTPUT, format!("cannot view {}: rerun ended with {status}", self.log.display())))
            }
            Err(error) => Err(Failure::new(OUTPUT, self.remedy(&error))),
        }
    }

    /// The reason why Rerun did not start, and what helps.
    fn remedy(&self, error: &std::io::Error) -> String {
        let log = self.log.display();
        match error.kind() {
            ErrorKind::NotFound => format!(
                "cannot view {log}: no `rerun` on the PATH; install it with `pip install rerun-sdk`, or open the log in Foxglove with the layout docs/viewers/foxglove.json"
            ),
            _ => format!("cannot view {log}: cannot start `rerun` ({error}); check its permissions"),
        }
    }
}

/// A temporary file with the blueprint; it is removed on drop.
struct Blueprint(PathBuf);

impl Blueprint {
    fn write() -> std::io::Result<Self> {
        let path = std::env::temp_dir().join(format!("seafix-{}.rbl", std::process::id()));
        let mut file = std::fs::File::create_new(&path)?;
        file.write_all(BLUEPRINT)?;
        Ok(Self(path))
    }
}

impl Drop for Blueprint {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
