//! Dead reckoning without images.

mod dead_reckoning;
mod integral;
mod settings;
mod signal;

pub use settings::DvlGyro;

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::Threads;

use crate::odometry::{Odometry, OdometrySession};
use dead_reckoning::DeadReckoning;

impl Odometry for DvlGyro {
    fn needs_readings(&self) -> bool {
        true
    }

    fn begin<'a>(
        &'a self,
        _: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
        _: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        Box::new(DeadReckoning::new(self, body_from_camera))
    }
}
