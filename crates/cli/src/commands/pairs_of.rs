//! The settings of the stereo pairs that a command reads from a data set, a recording or a log.

use std::path::Path;

use clap::Args;
use seafix_component::{Component, Fault};
use seafix_data::{StereoPairs, source::Mcap};
use seafix_experiment::changed;
use seafix_io::ImageLimits;

use crate::exit::{Failure, INPUT, USAGE};

/// How a recording is read.
#[derive(Debug, Args)]
pub(crate) struct PairsOf {
    /// Set how a recording is read: a setting of the source `mcap` and a TOML value, `left=/cam0/image_raw` or
    /// `stamps=log`; `seafix show mcap` lists them.
    #[arg(long, value_name = "KEY=VALUE")]
    source: Vec<String>,
}

impl PairsOf {
    /// Whether any setting is given.
    pub(crate) fn is_given(&self) -> bool {
        !self.source.is_empty()
    }

    /// Opens the pairs at `path`.
    ///
    /// # Errors
    /// An invalid setting (exit code 2), and all faults of the data.
    pub(crate) fn open(&self, path: &Path, sort_stamps: bool, limits: ImageLimits) -> Result<StereoPairs, Failure> {
        let given = Mcap {
            path: path.display().to_string(),
            sort_stamps,
            max_pixels: limits.pixels,
            max_bytes: limits.bytes,
            ..Mcap::default()
        };
        let settings = changed(&given, "--source", &self.source, "stamps=log")
            .map_err(|faults| Failure::faults(USAGE, &faults))?;
        settings.check().map_err(|what| Failure::new(USAGE, Fault::new(what, Path::new("--source"))))?;
        StereoPairs::open(path, &settings).map_err(|faults| Failure::faults(INPUT, &faults))
    }
}
