//! Odometry by registration of successive clouds (ICP).

mod align;
mod grid;
mod settings;
mod tracker;

pub use settings::{Distance, Icp};

use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::Threads;

use crate::odometry::{Odometry, OdometrySession};
use tracker::IcpTracker;

impl Odometry for Icp {
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        _: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        let front_end = self.front_end().expect("a component's settings were checked");
        Box::new(IcpTracker::new(self, front_end, rig, threads))
    }
}
