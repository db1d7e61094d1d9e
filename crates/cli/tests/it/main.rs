//! The program from outside.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may stop at once, and says what it measured")]

mod bad_input;
mod cloud;
mod draw;
mod eval;
mod evo;
#[cfg(unix)]
mod hyperqueue;
mod model;
mod odometry;
mod recordings;
mod runs;
#[cfg(target_os = "linux")]
mod safety;
#[cfg(target_os = "linux")]
mod slurm;
mod solve;
