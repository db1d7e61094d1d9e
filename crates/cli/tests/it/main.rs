//! Tests of the program as a process.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and print its measurements")]

use std::process::Command;

mod bad_input;
mod circles;
mod cloud;
mod compressed_recordings;
mod documentation;
mod eval;
mod fixes;
mod foreign_files;
mod foreign_rigs;
mod foreign_tables;
mod generate;
#[cfg(unix)]
mod hyperqueue;
mod layers;
mod model;
mod model_from_dive;
mod odometry;
#[cfg(unix)]
mod ownership;
mod recordings;
mod runs;
#[cfg(target_os = "linux")]
mod safety;
#[cfg(target_os = "linux")]
mod slurm;
mod solve;
mod supply;
#[cfg(unix)]
mod view;

/// The command of the program, without arguments.
fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_seafix"))
}

/// The result of a call: exit code, standard output and standard error.
struct Ended {
    code: Option<i32>,
    out: String,
    error: String,
}

fn ended(command: &mut Command) -> Ended {
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), error: text(output.stderr) }
}

/// The result of a call that must end with this exit code.
fn ended_with(code: i32, command: &mut Command) -> Ended {
    let ended = ended(command);
    assert_eq!(ended.code, Some(code), "{}{}", ended.out, ended.error);
    ended
}
