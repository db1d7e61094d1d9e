//! A planned dive as a sequence, common to both virtual sources.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Covariance6, StereoRig, Transform};
use seafix_referencing::Site;
use seafix_simulation::{Dive, PlannedDive};

use crate::sequence::{Sequence, Truth};

pub(super) fn open(dive: &Dive, seed: u64, images: bool) -> Result<Box<dyn Sequence>, Vec<Fault>> {
    let dive =
        dive.plan(seed, 0).map_err(|error| vec![Fault::new(error.to_string(), Path::new("the source's settings"))])?;
    let name = format!(
        "virtual site, seed {seed}, {} m, {}",
        dive.settings().distance,
        if images { "rendered" } else { "as points" }
    );
    Ok(Box::new(Virtual { dive, name, images }))
}

struct Virtual {
    dive: PlannedDive,
    name: String,
    images: bool,
}

impl Sequence for Virtual {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        self.dive.site()
    }

    fn rig(&self) -> &StereoRig {
        self.dive.rig()
    }

    /// The cameras look down: the right of the image is starboard, its lower edge is aft.
    fn body_from_camera(&self) -> Transform<Body, Camera> {
        let axes = Matrix3::from_columns(&[Vector3::y(), -Vector3::x(), Vector3::z()]);
        Transform::from_axes(&axes, Vector3::zeros())
    }

    fn images(&self) -> bool {
        self.images
    }

    fn frames(&self) -> usize {
        self.dive.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let settings = self.dive.settings();
        Some((settings.prior_position, settings.prior_attitude_deg.to_radians()))
    }

    fn pixel_sigma(&self) -> Option<f64> {
        (!self.images).then_some(self.dive.settings().points.sigma_px)
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let frame = self.dive.frame(index);
        let frame_data = if self.images {
            let (left, right) = frame.render();
            FrameData::Stereo(left, right)
        } else {
            FrameData::Points(frame.points())
        };
        let prior = PosePrior {
            world_from_camera: frame.prior.world_from_camera,
            covariance: Covariance6::isotropic(frame.prior.attitude_sigma, frame.prior.position_sigma),
        };
        Ok(SensorFrame {
            stamp_ns: frame.stamp_ns,
            frame_data,
            prior: Some(prior),
            hints: Hints::Nothing,
            readings: Vec::new(),
        })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let frame = self.dive.frame(index);
        let truth = frame.truth();
        Some(Truth {
            world_from_camera: truth.world_from_camera,
            world_from_object: self.dive.world_from_object().iter().copied().map(Some).collect(),
            visible: Some(truth.visible.iter().map(|seen| (seen.object, seen.point)).collect()),
            bound: None,
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        Ok(Vec::new())
    }
}
