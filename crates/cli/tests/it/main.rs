//! The program from outside.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may stop at once, and says what it measured")]

use std::process::Command;

mod bad_input;
mod cloud;
mod eval;
mod generate;
#[cfg(unix)]
mod hyperqueue;
mod layers;
mod model;
mod odometry;
mod recordings;
mod runs;
#[cfg(target_os = "linux")]
mod safety;
#[cfg(target_os = "linux")]
mod slurm;
mod solve;

/// The program, ready for its arguments.
fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_seafix"))
}

/// What a call of the program left: its exit code, and what it wrote on standard output and standard error.
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

/// What a call left that must end with this exit code.
fn ended_with(code: i32, command: &mut Command) -> Ended {
    let ended = ended(command);
    assert_eq!(ended.code, Some(code), "{}{}", ended.out, ended.error);
    ended
}
