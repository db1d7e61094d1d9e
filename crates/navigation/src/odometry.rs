//! The interface of all odometries.

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::{Image, Threads};

use crate::{
    odometry_trajectory::{OdometryOutcome, OdometryTrajectory, Waypoint},
    reading::Reading,
};

/// The two images of one instant.
#[derive(Debug, Clone, Copy)]
pub struct StereoPair<'a> {
    /// The time of exposure (ns).
    pub stamp_ns: u64,
    /// The left image.
    pub left: &'a Image,
    /// The right image.
    pub right: &'a Image,
}

/// A stamp that is not later than the previous one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("pair {pair}: stamp {stamp_ns} ns is not later than the previous one, {before_ns} ns; sort the pairs by time")]
pub struct NotAfter {
    /// The index of the pair, from 0.
    pub pair: usize,
    /// Its stamp (ns).
    pub stamp_ns: u64,
    /// The previous stamp (ns).
    pub before_ns: u64,
}

/// A constant error of a rig's disparities, as motion reveals it.
///
/// It displaces every point by z² δ/(f b) along its depth z. Causes are a principal point or a rotation of a camera
/// about its vertical axis that changed since the calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeOffset {
    /// The offset δ of the given rig (px): [`StereoRig::with_range_offset`] with this value corrects it.
    pub pixels: f64,
    /// Its standard deviation (px).
    pub sigma: f64,
    /// The number of windows of key frames that determine it.
    pub windows: usize,
    /// Whether the session has corrected it.
    pub corrected: bool,
}

/// The last stamp of a sequence, to check that stamps increase.
#[derive(Debug, Default)]
pub(crate) struct Stamps(Option<u64>);

impl Stamps {
    /// Takes the stamp of the pair with index `pair`.
    ///
    /// # Errors
    /// [`NotAfter`] if the stamp does not increase; the state is then unchanged.
    pub(crate) fn take(&mut self, pair: usize, stamp_ns: u64) -> Result<(), NotAfter> {
        if let Some(before_ns) = self.0.filter(|before| *before >= stamp_ns) {
            return Err(NotAfter { pair, stamp_ns, before_ns });
        }
        self.0 = Some(stamp_ns);
        Ok(())
    }
}

/// An odometry: it computes the motion of a stereo rig from its images or from readings of other sensors.
///
/// ```
/// use seafix_component::Choice;
/// use seafix_navigation::ODOMETRIES;
///
/// let odometry = ODOMETRIES.build(&Choice::named("stereo").with("window", 4)).unwrap();
/// assert!(!odometry.needs_readings(), "stereo odometry needs images only");
/// assert!(ODOMETRIES.build(&Choice::named("dvl-gyro")).unwrap().needs_readings());
/// ```
pub trait Odometry: Send + Sync + std::fmt::Debug {
    /// Whether the odometry needs sensor readings ([`OdometrySession::sense`]).
    fn needs_readings(&self) -> bool {
        false
    }

    /// A new session for a rig and its mounting in the vehicle; the result does not depend on the number of threads.
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a>;
}

/// An odometry at work on one sequence: pairs in order of time and readings go in, poses come out.
pub trait OdometrySession: Send {
    /// Takes a sensor reading; readings may arrive late. An odometry that uses images alone ignores it.
    fn sense(&mut self, _reading: &Reading) {}

    /// Takes the next pair and returns its preliminary outcome.
    ///
    /// # Errors
    /// [`NotAfter`] if its stamp does not increase; the state is then unchanged.
    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<OdometryOutcome, NotAfter>;

    /// The last waypoint and the index of its segment: the input of a navigator.
    fn latest(&self) -> Option<(usize, Waypoint)>;

    /// The trajectory up to now; later pairs may still refine poses and outcomes.
    fn trajectory(&self) -> OdometryTrajectory;

    /// The error of the rig's disparities that the motion reveals; `None` if it reveals none.
    fn range_offset(&self) -> Option<RangeOffset> {
        None
    }
}
