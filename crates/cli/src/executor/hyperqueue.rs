//! The executor for HyperQueue: one task array on its workers.

use super::array::{Array, Executor, engine, word};
use crate::exit::Failure;

/// A task array, submitted by `hq submit --array` to the server that `hq` finds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HyperQueue;

impl Executor for HyperQueue {
    fn variable(&self) -> &'static str {
        "HQ_TASK_ID"
    }

    fn run(&self, array: &Array) -> Result<(), Failure> {
        let log = format!("{}/%{{TASK_ID}}.log", word(&array.logs));
        let arguments = [
            "submit".to_owned(),
            "--wait".to_owned(),
            format!("--array=1-{}", array.tasks),
            format!("--cpus={}", array.threads),
            format!("--name={}", array.name),
            format!("--stdout={log}"),
            format!("--stderr={log}"),
            "sh".to_owned(),
            word(&array.script),
        ];
        engine("hq", "HyperQueue", &arguments.each_ref().map(String::as_str))
    }
}
