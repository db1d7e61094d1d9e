//! The `seafix` command.

use std::process::ExitCode;

use clap::Parser;

mod atomic_file;
mod catalogue;
mod commands;
mod executor;
mod exit;
mod ply;
mod publication;
mod signals;
mod terminal;

/// Position and attitude of an underwater vehicle relative to a known structure, from stereo images.
#[derive(Debug, Parser)]
#[command(name = "seafix", version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    signals::outgrow_files();
    match Arguments::parse().command.execute() {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            for line in &failure.lines {
                terminal::notify(&format!("error: {line}"));
            }
            ExitCode::from(failure.code)
        }
    }
}
