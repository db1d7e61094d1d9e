//! Recordings: the log of another run, and those of ROS 2.

use std::path::Path;

use seafix_component::{Component, Fault, in_range};
use seafix_io::ImageLimits;
use seafix_log::Recording;
use serde::{Deserialize, Serialize};

use super::{Sequence, Source, logged, logged::Logged, recorded::Recorded};
use crate::{dataset::SAME_INSTANT_NS, ros::Views};

/// Which of what a run logged is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoggedInput {
    /// Images where there are any, else clouds.
    #[default]
    Any,
    /// Images.
    Images,
    /// Clouds: the stages before the search do no work.
    Clouds,
}

/// Reads an MCAP file: the log of a trial, or a recording of ROS 2 with images, calibrations and poses (all settings but
/// `path` and `read` are about the latter).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mcap {
    /// The file; relative to the experiment file.
    pub path: String,
    /// Of our own logs: `images`, `clouds`, or `any`, images where there are any.
    pub read: LoggedInput,
    /// The file of the site to look for; relative to the experiment file. Its world is that of the poses.
    pub site: String,
    /// Topics of the left and the right images (Image, CompressedImage); empty: those whose names say so.
    pub left: String,
    /// See `left`.
    pub right: String,
    /// Topics of the calibrations (CameraInfo); empty: `camera_info` beside the images.
    pub left_info: String,
    /// See `left-info`.
    pub right_info: String,
    /// Whether the images are `rectified` or `raw`; `by-name`: rectified if their topic's name has `rect` in it.
    pub images: Views,
    /// The rough pose a method may use: a topic of Odometry, or `tf:FRAME`, the camera in that frame; empty: none.
    pub prior: String,
    /// Its standard deviation a world axis (m), and of the attitude a camera axis (degrees); 0: as the messages say.
    pub prior_position: f64,
    /// See `prior-position`.
    pub prior_attitude_deg: f64,
    /// The true pose, likewise; no method sees it.
    pub truth: String,
    /// Images of one instant have stamps within this (s).
    pub tolerance: f64,
    /// Between poses farther apart than this (s) nothing is known.
    pub max_gap: f64,
    /// Whether images out of order are sorted and the first of each stamp kept, instead of refused.
    pub sort_stamps: bool,
    /// Depth of the pixels in images of 16 bits.
    pub bits: u8,
    /// The most pixels that an image's header may declare.
    pub max_pixels: u64,
    /// The most memory that an image's decoder may take, and the largest image file (bytes).
    pub max_bytes: u64,
}

impl Default for Mcap {
    fn default() -> Self {
        let ImageLimits { pixels, bytes } = ImageLimits::default();
        let none = String::new;
        Self {
            path: none(),
            read: LoggedInput::Any,
            site: none(),
            left: none(),
            right: none(),
            left_info: none(),
            right_info: none(),
            images: Views::ByName,
            prior: none(),
            prior_position: 0.0,
            prior_attitude_deg: 0.0,
            truth: none(),
            tolerance: SAME_INSTANT_NS as f64 * 1e-9,
            max_gap: 0.2,
            sort_stamps: false,
            bits: 16,
            max_pixels: pixels,
            max_bytes: bytes,
        }
    }
}

impl Mcap {
    /// Standard deviations of the prior: position (m), attitude (rad); `None` where the messages tell.
    pub(super) fn prior_sigma(&self) -> Option<(f64, f64)> {
        (self.prior_position > 0.0).then(|| (self.prior_position, self.prior_attitude_deg.to_radians()))
    }

    /// The longest time between two poses (ns).
    pub(super) fn gap_ns(&self) -> u64 {
        (self.max_gap * 1e9) as u64
    }
}

impl Component for Mcap {
    const NAME: &'static str = "mcap";
    const SUMMARY: &'static str = "the frames that another run logged, or a recording of ROS 2";
    const SOURCE: &'static str = "mcap.dev";

    fn check(&self) -> Result<(), String> {
        in_range(!self.path.is_empty(), "path", "''", "an .mcap file, relative to the experiment file")?;
        let seconds = |value: f64| (0.0..=1e6).contains(&value);
        in_range(seconds(self.tolerance), "tolerance", self.tolerance, "0 to 1e6 seconds")?;
        in_range(seconds(self.max_gap), "max-gap", self.max_gap, "0 to 1e6 seconds")?;
        let (position, attitude) = (self.prior_position, self.prior_attitude_deg);
        in_range((0.0..=1e3).contains(&position), "prior-position", position, "0 to 1000")?;
        in_range((0.0..=180.0).contains(&attitude), "prior-attitude-deg", attitude, "0 to 180")?;
        in_range((position > 0.0) == (attitude > 0.0), "prior-attitude-deg", attitude, "both deviations, or neither")?;
        in_range([8, 12, 16].contains(&self.bits), "bits", self.bits, "8, 12 or 16")?;
        let max = i64::MAX as u64;
        in_range((1..=max).contains(&self.max_pixels), "max-pixels", self.max_pixels, "at least 1")?;
        in_range((1..=max).contains(&self.max_bytes), "max-bytes", self.max_bytes, "at least 1")
    }
}

impl Source for Mcap {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let path = folder.join(&self.path);
        let one = |fault| vec![fault];
        let recording = Recording::open(&path, |_| false).map_err(|error| one(logged::fault(&path, &error)))?;
        if recording.topics().iter().any(|topic| topic.schema == "seafix.v2.TrialHeader") {
            return Ok(Box::new(Logged::open(&path, self.read)?));
        }
        if self.site.is_empty() {
            let fault = Fault::new("a recording without a site", &path);
            return Err(one(fault.remedy("a fix needs a known object: set `site` to the file of one")));
        }
        Ok(Box::new(Recorded::open(&path, self, folder)?))
    }

    fn may_have_readings(&self) -> bool {
        true
    }
}
