//! `seafix convert`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use seafix_io::{
    calibration::{self, Calibration, Given},
    dataset::{Description, FORMATS},
};

use crate::{
    atomic_file,
    exit::{DONE, Ended, Failure, INPUT, OUTPUT},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Convert {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Convert a stereo calibration of another program to a data set description.
    Calibration(CalibrationFiles),
}

#[derive(Debug, Args)]
struct CalibrationFiles {
    /// The files: one, or left and right, or intrinsics and extrinsics.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The description to write; printed by default.
    #[arg(long)]
    out: Option<PathBuf>,
    /// The size of the images, WIDTHxHEIGHT, where the files do not state it.
    #[arg(long, value_parser = size)]
    size: Option<[u32; 2]>,
    /// The unit of the lengths in the files.
    #[arg(long, value_enum, default_value = "m")]
    unit: Unit,
}

/// A unit of length.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Unit {
    /// Metres.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides: Vec<u32> = text.split(['x', '×']).filter_map(|side| side.trim().parse().ok()).collect();
    sides.try_into().map_err(|_| "give WIDTHxHEIGHT, for example 1024x768".to_owned())
}

impl Convert {
    pub(crate) fn execute(&self) -> Ended {
        let What::Calibration(files) = &self.what;
        files.execute()
    }
}

impl CalibrationFiles {
    fn execute(&self) -> Ended {
        let unit = match self.unit {
            Unit::M => 1.0,
            Unit::Cm => 1e-2,
            Unit::Mm => 1e-3,
        };
        let found = calibration::read(&self.files, Given { size: self.size, unit });
        let found = found.map_err(|fault| Failure::new(INPUT, fault))?;
        let name = self.files[0].file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        notify(&summary(&found));
        found.warning.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        let text = toml::to_string(&description(&name, found))
            .map_err(|error| Failure::new(OUTPUT, format!("cannot write the description: {error}")))?;
        match &self.out {
            Some(path) => atomic_file::write(path, &text)?,
            None => print(&text)?,
        }
        Ok(DONE)
    }
}

/// A calibration in one line.
pub(crate) fn summary(found: &Calibration) -> String {
    let ([width, height], [fx, fy]) = (found.rig.left().size(), found.rig.left().focal());
    let t = found.rig.right_from_left().inverse().translation();
    let notes: String = found.notes.iter().map(|note| format!("; {note}")).collect();
    format!(
        "{}: {width}×{height} px, f = {fx:.1}, {fy:.1} px, right camera at [{:.4}, {:.4}, {:.4}] m, baseline {:.4} m{notes}",
        found.format,
        t.x,
        t.y,
        t.z,
        found.rig.baseline()
    )
}

/// A description whose other files the user adds.
fn description(name: &str, found: Calibration) -> Description {
    Description {
        format: FORMATS[2].to_owned(),
        name: name.to_owned(),
        licence: "unknown".to_owned(),
        origin: Some(format!("calibration from {}", found.format)),
        frames: "frames.csv".to_owned(),
        site: None,
        truth: None,
        prior: None,
        prior_sigma: None,
        prior_covariance: None,
        visibility: None,
        objects: None,
        doppler: None,
        gyro: None,
        body_from_camera: None,
        bits: None,
        rig: found.numbers,
        hashes: std::collections::BTreeMap::new(),
    }
}
