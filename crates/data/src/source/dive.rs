//! Simulated dives with vehicle, lamps and water.

use std::path::{Path, PathBuf};

use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_component::{Component, Fault, Settings};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_referencing::Site;
use seafix_simulation::{CALIBRATION_RANGE, Mission, PlannedMission, optics::PortKind};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use super::readings;
use crate::{
    dataset::sha256,
    ports::CalibratedPort,
    sensor_buffer::SensorBuffer,
    sequence::{Sequence, Source, Truth},
};

/// A source that simulates a vehicle's dive over a given site, under lamps in water. Every disturbance is a setting. It
/// gives rendered stereo pairs, or with `as-points` clouds of the same views.
#[derive(Debug, Clone, Default, Serialize, Deserialize, Settings)]
#[serde(transparent)]
pub struct Dive(pub Mission);

impl Component for Dive {
    const NAME: &'static str = "dive";
    const SUMMARY: &'static str = "a vehicle's dive over a site under lamps in water, every disturbance a setting";
    const SOURCE: &'static str = "water: Jaffe 1990, Song et al. 2020; vehicle: Fossen 2021; sensor: EMVA 1288";

    fn check(&self) -> Result<(), String> {
        self.0.check()
    }
}

impl Source for Dive {
    fn open(&self, seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let mission = self.0.plan(seed, 0, folder)?;
        let settings = mission.settings();
        let name = format!("dive over {}, seed {seed}, c = {} 1/m", settings.site, settings.water.c());
        let sensor_buffer = readings::sensor_buffer(&mission);
        let models = self.0.model_files(folder)?;
        Ok(Box::new(Dived { mission, sensor_buffer, name, models }))
    }

    fn may_have_readings(&self) -> bool {
        true
    }
}

struct Dived {
    mission: PlannedMission,
    sensor_buffer: SensorBuffer,
    name: String,
    /// The files of given models, by the names that the settings give them.
    models: Vec<(String, PathBuf)>,
}

impl Sequence for Dived {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        self.mission.site()
    }

    fn rig(&self) -> &StereoRig {
        self.mission.rig()
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.mission.body_from_camera()
    }

    fn images(&self) -> bool {
        !self.mission.settings().as_points
    }

    fn frames(&self) -> usize {
        self.mission.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let (_, covariance) = (0..self.frames()).find_map(|index| self.mission.instant(index).prior)?;
        Some((covariance.position_sigma(), covariance.attitude_sigma()))
    }

    fn pixel_sigma(&self) -> Option<f64> {
        (!self.images()).then_some(self.mission.settings().points.sigma_px)
    }

    fn bits(&self) -> u8 {
        self.mission.settings().imager.bits
    }

    fn ports(&self) -> [Option<CalibratedPort>; 2] {
        let port = self.mission.settings().rig.port.clone();
        let port = (port.kind != PortKind::None).then_some(CalibratedPort { port, range: CALIBRATION_RANGE });
        [port.clone(), port]
    }

    fn has_readings(&self) -> bool {
        self.sensor_buffer.is_complete()
    }

    fn sensors(&self) -> Vec<(String, String)> {
        readings::tables(&self.mission)
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let instant = self.mission.instant(index);
        let frame_data = if self.images() {
            let (left, right, _) = instant.render(Threads::Pool);
            FrameData::Stereo(left, right)
        } else {
            FrameData::Points(instant.points())
        };
        let prior = instant.prior.map(|(world_from_camera, covariance)| PosePrior { world_from_camera, covariance });
        let before = index.checked_sub(1).map(|before| self.mission.instant(before).stamp_ns);
        let readings = self.sensor_buffer.between(before, instant.stamp_ns);
        Ok(SensorFrame { stamp_ns: instant.stamp_ns, frame_data, prior, hints: Hints::Nothing, readings })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let instant = self.mission.instant(index);
        let truth = instant.truth();
        Some(Truth {
            world_from_camera: truth.world_from_camera,
            world_from_object: self.mission.world_from_object().iter().copied().map(Some).collect(),
            visible: Some(truth.visible.iter().map(|seen| (seen.object, seen.point)).collect()),
            bound: None,
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        self.models.iter().map(|(name, file)| Ok((name.clone(), sha256(file)?))).collect()
    }
}
