//! Who runs the parts of a sweep. Seafix cuts and merges; an engine that exists already schedules, retries and spreads.

mod hyperqueue;
mod local;
mod slurm;

use std::path::{Path, PathBuf};

use crate::exit::{Failure, OUTPUT};

pub(crate) use hyperqueue::HyperQueue;
pub(crate) use local::Local;
pub(crate) use slurm::Slurm;

/// One script, run once for every task from 1 to `tasks`.
#[derive(Debug)]
pub(crate) struct Array {
    /// A shell script that reads the number of its task from the variable that [`Executor::variable`] names.
    pub(crate) script: PathBuf,
    /// How many tasks.
    pub(crate) tasks: usize,
    /// Threads that each task uses.
    pub(crate) threads: usize,
    /// What the engine calls the whole.
    pub(crate) name: String,
    /// Where what task k says goes: `k.log`.
    pub(crate) logs: PathBuf,
}

/// Runs the tasks of an array, wherever, and waits for them.
pub(crate) trait Executor {
    /// The variable that holds the number of a task.
    fn variable(&self) -> &'static str;

    /// Returns when every task has ended. Whether they did their work shows in what they leave.
    ///
    /// # Errors
    /// The engine cannot be reached, or refuses the array.
    fn run(&self, array: &Array) -> Result<(), Failure>;
}

/// A command of an engine that must be there.
fn engine(program: &str, engine: &str, arguments: &[&str]) -> Result<(), Failure> {
    let status = std::process::Command::new(program).args(arguments).status();
    match status {
        // A task that failed makes the engine's command fail: the shards tell which.
        Ok(_) => Ok(()),
        Err(error) => Err(Failure::new(
            OUTPUT,
            format!("cannot run `{program}` ({error}); install {engine}, or sweep with --executor local"),
        )),
    }
}

fn word(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
