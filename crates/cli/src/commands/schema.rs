//! `seafix schema`.

use clap::ValueEnum;

use crate::{
    exit::{DONE, Ended},
    settings,
    terminal::print,
};

/// The formats that have a schema.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Format {
    /// An experiment file.
    Experiment,
}

pub(crate) fn execute(of: Format) -> Ended {
    let schema = match of {
        Format::Experiment => settings::experiment(),
    };
    print(&format!("{schema:#}\n"))?;
    Ok(DONE)
}
