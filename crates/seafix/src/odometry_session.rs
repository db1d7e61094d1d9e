//! An odometry between the frames of a passage.

use std::time::Instant;

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_navigation::{Odometry, OdometryOutcome, OdometrySession, StereoPair, Waypoint};
use seafix_vision::Threads;

use crate::{FrameData, SensorFrame, times::milliseconds};

/// An odometry on its way through the frames of a passage. It depends on no fix, so that trials with the same odometry can
/// share it.
pub struct TrialOdometry<'a>(Box<dyn OdometrySession + 'a>);

/// The odometry's result for one frame.
pub struct OdometryResult {
    /// Whether the pair was followed, began a segment, or was skipped.
    pub followed: OdometryOutcome,
    /// The last waypoint and the number of its segment.
    pub latest: Option<(usize, Waypoint)>,
    /// Duration (ms).
    pub ms: f64,
}

impl<'a> TrialOdometry<'a> {
    /// It has seen nothing yet.
    pub fn begin(odometry: &'a dyn Odometry, rig: &'a StereoRig, body_from_camera: Transform<Body, Camera>) -> Self {
        Self(odometry.begin(rig, body_from_camera, Threads::One))
    }

    /// The next frame, and what the vehicle's sensors told since the one before.
    ///
    /// # Errors
    /// A sentence: the frame is no stereo pair, or not after the one before.
    pub fn advance(&mut self, sensor_frame: &SensorFrame) -> Result<OdometryResult, String> {
        let start = Instant::now();
        let pair = stereo_pair(sensor_frame)?;
        sensor_frame.readings.iter().for_each(|reading| self.0.sense(reading));
        let followed = self.0.advance(&pair).map_err(|error| error.to_string())?;
        Ok(OdometryResult { followed, latest: self.0.latest(), ms: milliseconds(start) })
    }
}

/// The images of a frame.
///
/// # Errors
/// A sentence: it has none.
pub fn stereo_pair(sensor_frame: &SensorFrame) -> Result<StereoPair<'_>, String> {
    let FrameData::Stereo(left, right) = &sensor_frame.frame_data else {
        return Err("a frame without images".to_owned());
    };
    Ok(StereoPair { stamp_ns: sensor_frame.stamp_ns, left, right })
}
