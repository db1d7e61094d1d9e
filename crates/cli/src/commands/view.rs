//! `seafix view`.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    process::Command,
};

use clap::Args;
use seafix_component::Fault;
use seafix_log::Reader;

use crate::exit::{DONE, Ended, Failure, INPUT, OUTPUT};

/// The blueprint of Rerun that `docs/viewers/blueprint.py` writes.
const BLUEPRINT: &[u8] = include_bytes!("../../../../docs/viewers/seafix.rbl");
/// The application of the blueprint. Rerun applies a blueprint to recordings of its own application only.
const APPLICATION: &str = "seafix";

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
        let scratch = Scratch::new()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot write a temporary folder: {error}")))?;
        let [blueprint, converted, merged] = ["seafix.rbl", "log.rrd", "view.rrd"].map(|name| scratch.0.join(name));
        let mut convert = Command::new("rerun");
        convert.args(["mcap", "convert"]).arg(&self.log).args(["--application-id", APPLICATION, "-o"]).arg(&converted);
        self.prepared(convert)?;
        let mut merge = Command::new("rerun");
        merge.args(["rrd", "merge"]).arg(&converted).arg(&blueprint).arg("-o").arg(&merged);
        self.prepared(merge)?;
        match Command::new("rerun").arg(&merged).status() {
            Ok(status) if status.success() => Ok(DONE),
            Ok(status) => {
                Err(Failure::new(OUTPUT, format!("cannot view {}: rerun ended with {status}", self.log.display())))
            }
            Err(error) => Err(Failure::new(OUTPUT, self.remedy(&error))),
        }
    }

    /// Runs a step of the preparation without its messages.
    fn prepared(&self, mut step: Command) -> Result<(), Failure> {
        let output = step.output().map_err(|error| Failure::new(OUTPUT, self.remedy(&error)))?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
        let log = self.log.display();
        Err(Failure::new(
            OUTPUT,
            format!("cannot view {log}: rerun cannot prepare it ({last}); update it with `pip install -U rerun-sdk`"),
        ))
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

/// A temporary folder with the blueprint; it is removed on drop.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> std::io::Result<Self> {
        let scratch = Self(std::env::temp_dir().join(format!("seafix-view-{}", std::process::id())));
        std::fs::create_dir(&scratch.0)?;
        std::fs::write(scratch.0.join("seafix.rbl"), BLUEPRINT)?;
        Ok(scratch)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _: Result<(), _> = remove(&self.0);
    }
}

/// Removes the files that `view` makes and their folder.
fn remove(folder: &Path) -> std::io::Result<()> {
    for name in ["seafix.rbl", "log.rrd", "view.rrd"] {
        let _ = std::fs::remove_file(folder.join(name));
    }
    std::fs::remove_dir(folder)
}
