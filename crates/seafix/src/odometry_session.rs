//! The odometry of a sequence of sensor frames.

use std::time::Instant;

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_navigation::{Odometry, OdometryOutcome, OdometrySession, RangeOffset, StereoPair, Waypoint};
use seafix_vision::Threads;

use crate::{
    sensor_frame::{FrameData, SensorFrame},
    times::milliseconds,
};

/// An odometry at work on a sequence of frames. It is independent of fixes, so that trials with the same odometry share
/// it.
pub struct FrameOdometry<'a>(Box<dyn OdometrySession + 'a>);

/// The odometry's result for one frame.
pub struct OdometryResult {
    /// Whether the frame extended a segment, began one, or was skipped.
    pub outcome: OdometryOutcome,
    /// The last waypoint and the index of its segment.
    pub latest: Option<(usize, Waypoint)>,
    /// The duration (ms).
    pub ms: f64,
}

impl<'a> FrameOdometry<'a> {
    /// The odometry before its first frame.
    pub fn begin(odometry: &'a dyn Odometry, rig: &'a StereoRig, body_from_camera: Transform<Body, Camera>) -> Self {
        Self(odometry.begin(rig, body_from_camera, Threads::One))
    }

    /// Processes the next frame with the sensor readings since the previous one.
    ///
    /// # Errors
    /// The cause as a sentence: a frame without images, or one that is not later than the previous frame.
    pub fn advance(&mut self, sensor_frame: &SensorFrame) -> Result<OdometryResult, String> {
        let start = Instant::now();
        let pair = stereo_pair(sensor_frame)?;
        sensor_frame.readings.iter().for_each(|reading| self.0.sense(reading));
        let outcome = self.0.advance(&pair).map_err(|error| error.to_string())?;
        Ok(OdometryResult { outcome, latest: self.0.latest(), ms: milliseconds(start) })
    }

    /// The error of the rig's disparities that the motion has revealed; `None` if it has revealed none.
    pub fn range_offset(&self) -> Option<RangeOffset> {
        self.0.range_offset()
    }
}

/// The stereo pair of a frame.
///
/// # Errors
/// The cause as a sentence: a frame without images.
pub fn stereo_pair(sensor_frame: &SensorFrame) -> Result<StereoPair<'_>, String> {
    let FrameData::Stereo(left, right) = &sensor_frame.frame_data else {
        return Err("no images, but odometry needs a stereo pair".to_owned());
    };
    Ok(StereoPair { stamp_ns: sensor_frame.stamp_ns, left, right })
}
