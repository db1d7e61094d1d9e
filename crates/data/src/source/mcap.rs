//! Settings of MCAP files: logs of other runs, and ROS 2 recordings.

use seafix_component::{Component, Settings, in_range};
use seafix_io::ImageLimits;
use serde::{Deserialize, Serialize};

use crate::{dataset::SAME_INSTANT_NS, ros::Views};

/// The part of a log's inputs to replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum LoggedInput {
    /// Images if there are any, otherwise clouds.
    #[default]
    Any,
    /// Images.
    Images,
    /// Clouds; the front end does not run.
    Clouds,
}

/// The stamps of images and poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Stamps {
    /// The stamp in the message's header, the time of capture.
    #[default]
    Header,
    /// The time of recording.
    Log,
}

/// A reader of MCAP files: the log of a trial, or a ROS 2 recording with images, calibrations and poses. All settings
/// except `path` and `read` apply to ROS 2 recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mcap {
    /// The file, or a folder of rosbag2, relative to the experiment file.
    pub path: String,
    /// The part of a Seafix log to replay: `images`, `clouds`, or `any` (images if there are any).
    pub read: LoggedInput,
    /// The site file, relative to the experiment file. Its world frame is that of the poses.
    pub site: String,
    /// The topic of the left images (Image or CompressedImage); found by its name if empty.
    pub left: String,
    /// The topic of the right images, like `left`.
    pub right: String,
    /// The topic of the left calibration (CameraInfo); `camera_info` beside the images if empty.
    pub left_info: String,
    /// The topic of the right calibration, like `left-info`.
    pub right_info: String,
    /// The kind of the images, `rectified` or `raw`; `auto` decides by the calibration and by the matches of the images.
    pub images: Views,
    /// The stamps of images and poses: `header`, or `log` for the times of recording where a driver sets none.
    pub stamps: Stamps,
    /// The prior pose: a topic of Odometry, PoseStamped or PoseWithCovarianceStamped, or `tf:FRAME` for the pose of the
    /// camera in that frame; no prior if empty.
    pub prior: String,
    /// The frame whose pose messages without a child frame state; the left camera's if empty.
    pub pose_frame: String,
    /// The standard deviation of the prior's position per world axis (m); 0 uses the covariances of the messages.
    pub prior_position: f64,
    /// The standard deviation of the prior's attitude per camera axis (degrees); 0 uses the covariances of the
    /// messages.
    pub prior_attitude_deg: f64,
    /// The ground truth pose, in the form of `prior`; methods do not receive it.
    pub truth: String,
    /// The maximum difference of the two stamps of a pair (s).
    pub tolerance: f64,
    /// The maximum time between two poses for interpolation (s).
    pub max_gap: f64,
    /// Whether images are sorted by time, keeping the first of each stamp. Otherwise images out of order are rejected.
    pub sort_stamps: bool,
    /// The number of significant bits of a pixel in images of 16 bits.
    pub bits: u8,
    /// The maximum number of pixels in an image's header.
    pub max_pixels: u64,
    /// The maximum size of an image file and of its decoder's memory (bytes).
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
            images: Views::Auto,
            stamps: Stamps::Header,
            prior: none(),
            pose_frame: none(),
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
    /// The standard deviations of the prior: position (m), attitude (rad); `None` if the messages have covariances.
    pub(super) fn prior_sigma(&self) -> Option<(f64, f64)> {
        (self.prior_position > 0.0).then(|| (self.prior_position, self.prior_attitude_deg.to_radians()))
    }

    /// The maximum time between two poses for interpolation (ns).
    pub(super) fn gap_ns(&self) -> u64 {
        (self.max_gap * 1e9) as u64
    }
}

impl Component for Mcap {
    const NAME: &'static str = "mcap";
    const SUMMARY: &'static str = "the frames that another run logged, or a recording of ROS 2";
    const SOURCE: &'static str = "mcap.dev";

    fn check(&self) -> Result<(), String> {
        in_range(
            !self.path.is_empty(),
            "path",
            "''",
            "an .mcap file or a folder of rosbag2, relative to the experiment file",
        )?;
        let seconds = |value: f64| (0.0..=1e6).contains(&value);
        in_range(seconds(self.tolerance), "tolerance", self.tolerance, "0 to 1e6 seconds")?;
        in_range(seconds(self.max_gap), "max-gap", self.max_gap, "0 to 1e6 seconds")?;
        let (position, attitude) = (self.prior_position, self.prior_attitude_deg);
        in_range((0.0..=1e3).contains(&position), "prior-position", position, "0 to 1000")?;
        in_range((0.0..=180.0).contains(&attitude), "prior-attitude-deg", attitude, "0 to 180")?;
        in_range(
            (position > 0.0) == (attitude > 0.0),
            "prior-attitude-deg",
            attitude,
            "both standard deviations or neither",
        )?;
        in_range([8, 12, 16].contains(&self.bits), "bits", self.bits, "8, 12 or 16")?;
        let max = i64::MAX as u64;
        in_range((1..=max).contains(&self.max_pixels), "max-pixels", self.max_pixels, "at least 1")?;
        in_range((1..=max).contains(&self.max_bytes), "max-bytes", self.max_bytes, "at least 1")
    }
}
