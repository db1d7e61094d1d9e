//! The executor for a Slurm cluster: one job array.

use super::array::{Array, Executor, engine, word};
use crate::exit::Failure;

/// A job array, submitted by `sbatch --array`; all nodes share a file system.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slurm;

impl Executor for Slurm {
    fn variable(&self) -> &'static str {
        "SLURM_ARRAY_TASK_ID"
    }

    fn run(&self, array: &Array) -> Result<(), Failure> {
        let arguments = [
            "--wait".to_owned(),
            "--parsable".to_owned(),
            format!("--array=1-{}", array.tasks),
            format!("--cpus-per-task={}", array.threads),
            format!("--job-name={}", array.name),
            format!("--output={}/%a.log", word(&array.logs)),
            word(&array.script),
        ];
        engine("sbatch", "Slurm", &arguments.each_ref().map(String::as_str))
    }
}
