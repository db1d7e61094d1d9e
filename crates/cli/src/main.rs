//! The `seafix` command.

use std::process::ExitCode;

use clap::Parser;

mod atomic_file;
mod catalogue;
mod commands;
mod executor;
mod exit;
#[cfg(test)]
mod gallery;
mod ply;
mod publication;
#[cfg(test)]
mod reference;
mod settings;
mod signals;
mod terminal;
mod usage;

fn main() -> ExitCode {
    signals::ignore_size_limit_signal();
    let arguments = commands::Arguments::try_parse().unwrap_or_else(|error| usage::usage_error(&error));
    match arguments.command.execute() {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            for line in &failure.lines {
                terminal::notify(&format!("error: {line}"));
            }
            ExitCode::from(failure.code)
        }
    }
}
