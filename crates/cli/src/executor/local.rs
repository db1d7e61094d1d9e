//! The executor on this machine.

use std::{
    fs::File,
    process::{Child, Command, Stdio},
};

use super::array::{Array, Executor};
use crate::{
    exit::{Failure, OUTPUT},
    signals,
};

/// The local executor: as many simultaneous tasks as the machine has cores for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Local;

impl Executor for Local {
    fn variable(&self) -> &'static str {
        "SEAFIX_TASK"
    }

    fn run(&self, array: &Array) -> Result<(), Failure> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let max = (cores / array.threads.max(1)).max(1);
        let mut running: Vec<Child> = Vec::new();
        for task in 1..=array.tasks {
            while running.len() >= max {
                wait(&mut running);
            }
            if signals::interrupted() {
                break;
            }
            running.push(self.begin(array, task)?);
        }
        while !running.is_empty() {
            wait(&mut running);
        }
        Ok(())
    }
}

impl Local {
    fn begin(self, array: &Array, task: usize) -> Result<Child, Failure> {
        let path = array.logs.join(format!("{task}.log"));
        let write_error =
            |error: std::io::Error| Failure::new(OUTPUT, format!("cannot write {}: {error}", path.display()));
        if path.is_symlink() {
            let what = format!("cannot write {}: a symbolic link; remove it", path.display());
            return Err(Failure::new(OUTPUT, what));
        }
        let log = File::create(&path).map_err(write_error)?;
        let errors = log.try_clone().map_err(write_error)?;
        let mut command = Command::new("sh");
        command.arg(&array.script).env(self.variable(), task.to_string());
        let child = command.stdin(Stdio::null()).stdout(log).stderr(errors).spawn();
        child.map_err(|error| Failure::new(OUTPUT, format!("cannot start task {task}: {error}")))
    }
}

/// Waits until one of them has ended.
fn wait(running: &mut Vec<Child>) {
    let before = running.len();
    loop {
        // A process whose state cannot be read counts as ended.
        running.retain_mut(|child| matches!(child.try_wait(), Ok(None)));
        if running.len() < before {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}
