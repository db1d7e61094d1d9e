//! What every odometry does.

use seafix_component::{Registry, entry};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::{Image, Threads};

use crate::{DvlGyro, Icp, OdometryOutcome, OdometryTrajectory, Reading, Stereo, Waypoint};

/// The two images of one instant.
#[derive(Debug, Clone, Copy)]
pub struct StereoPair<'a> {
    /// When they were taken (ns).
    pub stamp_ns: u64,
    /// The left image.
    pub left: &'a Image,
    /// The right image.
    pub right: &'a Image,
}

/// A stamp that is not after the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "pair {pair}: stamp {stamp_ns} ns is not after the one before, {before_ns} ns; give the pairs in order of time"
)]
pub struct NotAfter {
    /// Which pair, from 0.
    pub pair: usize,
    /// Its stamp (ns).
    pub stamp_ns: u64,
    /// The stamp before (ns).
    pub before_ns: u64,
}

/// The stamps of a journey's pairs, each after the one before.
#[derive(Debug, Default)]
pub(crate) struct Stamps(Option<u64>);

impl Stamps {
    /// Takes the stamp of the next pair, `pair` its number from 0.
    ///
    /// # Errors
    /// [`NotAfter`] when it is not the next; nothing changes then.
    pub(crate) fn take(&mut self, pair: usize, stamp_ns: u64) -> Result<(), NotAfter> {
        if let Some(before_ns) = self.0.filter(|before| *before >= stamp_ns) {
            return Err(NotAfter { pair, stamp_ns, before_ns });
        }
        self.0 = Some(stamp_ns);
        Ok(())
    }
}

/// Computes the motion of a stereo rig from the images it took, or from what other sensors of the vehicle say.
pub trait Odometry: Send + Sync + std::fmt::Debug {
    /// Whether it goes by readings ([`OdometrySession::sense`]) and cannot do without.
    fn listens(&self) -> bool {
        false
    }

    /// Begins with nothing seen yet, for this rig, which sits there in the vehicle. The result does not depend on who works.
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a>;
}

/// An odometry at work: pairs go in, in order of time, and between them readings as they come; poses come out.
pub trait OdometrySession: Send {
    /// Takes a reading, whenever it was made; one that goes by images alone has no use for it.
    fn sense(&mut self, _reading: &Reading) {}

    /// Takes the next pair; what became of it, as far as is known by now.
    ///
    /// # Errors
    /// [`NotAfter`] when it is not the next; nothing changes then.
    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<OdometryOutcome, NotAfter>;

    /// The last waypoint and the number of its segment: what one that navigates needs of the journey.
    fn latest(&self) -> Option<(usize, Waypoint)>;

    /// All that is known by now: later pairs may still improve poses and explain outcomes.
    fn trajectory(&self) -> OdometryTrajectory;
}

/// All odometries.
pub static ODOMETRIES: Registry<dyn Odometry> =
    Registry::new("odometry", &[entry!(DvlGyro), entry!(Icp), entry!(Stereo)]);
