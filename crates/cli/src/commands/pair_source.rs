//! The settings of the stereo pairs that a command reads from a data set, a recording or a log.

use std::path::Path;

use clap::Args;
use seafix_component::{Component, Fault};
use seafix_data::{StereoPairs, source::Mcap};
use seafix_experiment::changed;
use seafix_io::ImageLimits;
use seafix_navigation::Odometry;
use seafix_vision::RightCameraRotation;

use crate::exit::{Failure, INPUT, USAGE};

/// The source of stereo pairs, and how a recording is read.
#[derive(Debug, Args)]
pub(crate) struct PairSource {
    /// Set how a recording is read: a setting of the source `mcap` and a TOML value, `left=/cam0/image_raw` or
    /// `stamps=log`; `seafix show mcap` lists them.
    #[arg(long, value_name = "KEY=VALUE")]
    source: Vec<String>,
}

impl PairSource {
    /// Rejects settings of a recording beside two images.
    ///
    /// # Errors
    /// A setting is given (exit code 2).
    pub(crate) fn of_no_recording(&self) -> Result<(), Failure> {
        if self.source.is_empty() {
            return Ok(());
        }
        let what = "cannot use --source: two images have no topics; give a recording in place of the images";
        Err(Failure::new(USAGE, what))
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

/// The fault of pairs without the readings that the odometry `name` needs.
///
/// # Errors
/// See above (exit code 3).
pub(crate) fn with_readings(pairs: &StereoPairs, odometry: &dyn Odometry, name: &str) -> Result<(), Failure> {
    if !odometry.needs_readings() || pairs.has_readings() {
        return Ok(());
    }
    let description = pairs.path().join("dataset.toml");
    let file = if description.exists() { &description } else { pairs.path() };
    let fault = Fault::new(format!("no readings for odometry `{name}`"), file)
        .remedy("name the tables of the Doppler log and the gyro, `doppler = …` and `gyro = …`, or use `stereo`");
    Err(Failure::new(INPUT, fault))
}

/// The warning of a corrected rotation of the right camera.
pub(crate) fn turned(found: &RightCameraRotation) -> String {
    let [baseline, ray] = found.turn.map(f64::to_degrees);
    format!(
        "the images contradict the rig: matches are {:.1} px (median) off its epipolar lines; the right camera was turned by \
         {baseline:.3}° about the baseline and {ray:.3}° about its line of sight, which leaves {:.1} px (`--keep-rig` \
         prevents it); calibrate again, since other parameters may be wrong too",
        found.given_px, found.left_px
    )
}
