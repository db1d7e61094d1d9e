//! Stereo visual odometry.

pub(crate) mod consensus;
mod follow;
pub(crate) mod front_end;
mod landmark;
pub(crate) mod pose;
mod range_offset;
mod settings;
mod taken;
mod tracker;
mod window;

pub use settings::Stereo;
pub(crate) use settings::StereoStages;

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::Threads;

use crate::odometry::{Odometry, OdometrySession};
use tracker::StereoTracker;

impl Odometry for Stereo {
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        _: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        let stages = self.stages().expect("a component's settings were checked");
        Box::new(StereoTracker::new(self, stages, rig, threads))
    }
}
