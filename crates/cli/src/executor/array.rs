//! Arrays of tasks, and the engines that run them.

use std::path::{Path, PathBuf};

use crate::exit::{Failure, OUTPUT};

/// One script, run once for every task from 1 to `tasks`.
#[derive(Debug)]
pub(crate) struct Array {
    /// A shell script that reads the number of its task from the variable that [`Executor::variable`] names.
    pub(crate) script: PathBuf,
    /// Number of tasks.
    pub(crate) tasks: usize,
    /// Number of threads of each task.
    pub(crate) threads: usize,
    /// Name of the array in the engine.
    pub(crate) name: String,
    /// Folder of the tasks' output; that of task k is `k.log`.
    pub(crate) logs: PathBuf,
}

/// An engine that runs the tasks of an array and waits for them.
pub(crate) trait Executor {
    /// The environment variable with the number of a task.
    fn variable(&self) -> &'static str;

    /// Runs all tasks and returns when they have ended. Their success is judged by the shards they leave.
    ///
    /// # Errors
    /// The engine cannot be reached, or rejects the array.
    fn run(&self, array: &Array) -> Result<(), Failure>;
}

/// Runs a command of an engine.
pub(super) fn engine(program: &str, engine: &str, arguments: &[&str]) -> Result<(), Failure> {
    let status = std::process::Command::new(program).args(arguments).status();
    match status {
        // A failed task makes the engine's command fail; the shards show which task it was.
        Ok(_) => Ok(()),
        Err(error) => Err(Failure::new(
            OUTPUT,
            format!("cannot run `{program}`: {error}; install {engine}, or use --executor local"),
        )),
    }
}

pub(super) fn word(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
