//! `seafix completions` and `seafix man`, derived from the definition of the command line.

use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_complete::Shell;
use seafix_component::{Fault, create_real_folder};

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT},
    terminal::print,
};

/// The program's name in completions and manual pages.
const PROGRAM: &str = "seafix";

/// The completion script of a shell.
#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub(crate) fn execute(&self, mut program: Command) -> Ended {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, PROGRAM, &mut script);
        print(&String::from_utf8_lossy(&script))?;
        Ok(DONE)
    }
}

/// The manual pages.
#[derive(Debug, Args)]
pub(crate) struct Man {
    /// The folder for the pages, one for each command; new or empty.
    folder: PathBuf,
}

impl Man {
    pub(crate) fn execute(&self, program: Command) -> Ended {
        let write = |folder: &Path| {
            create_real_folder(folder)?;
            if std::fs::read_dir(folder)?.next().is_some() {
                return Err(std::io::Error::other("it is not empty"));
            }
            clap_mangen::generate_to(program.name(PROGRAM), folder)
        };
        write(&self.folder).map_err(|error| {
            let what = format!("cannot write manual pages ({error})");
            Failure::new(OUTPUT, Fault::new(what, &self.folder).remedy("name a new or empty folder"))
        })?;
        Ok(DONE)
    }
}
