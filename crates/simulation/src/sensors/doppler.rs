//! The Doppler velocity log.

use nalgebra::Vector3;
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use super::reading::{TimedReading, within};
use crate::{
    scene::Scene,
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// Angle of the four beams to the vertical (degrees).
const BEAM_DEG: f64 = 30.0;
/// Fraction of the beams on a structure that give a velocity.
const ON_STRUCTURE: f64 = 0.5;

/// The sensor's velocity over ground in the body frame, with a constant scale error and white noise.
///
/// The scale error is sampled once for a dive. A velocity needs three of four beams; a beam that meets a structure
/// fails in half of the pings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Doppler {
    /// Position of the sensor in the body frame (m), from −10 to 10 each.
    pub at: [f64; 3],
    /// Standard deviation of the relative scale error, from 0 to 0.5.
    pub scale: f64,
    /// Standard deviation of the white noise on each axis (m/s), from 0 to 10.
    pub sigma: f64,
    /// Ping rate (Hz), from 0.001 to 100.
    pub rate: f64,
    /// Minimum and maximum length of a beam (m): the minimum from 0 to 100, the maximum up to 10 000.
    pub reach: [f64; 2],
    /// Delay between measurement and arrival of a reading (s), from 0 to 60.
    pub latency: f64,
    /// Fraction of readings that are lost, from 0 to 1.
    pub dropouts: f64,
}

impl Default for Doppler {
    fn default() -> Self {
        Self { at: [0.0; 3], scale: 0.002, sigma: 0.004, rate: 5.0, reach: [0.4, 100.0], latency: 0.05, dropouts: 0.0 }
    }
}

impl Doppler {
    pub(super) fn check(&self) -> Result<(), String> {
        let within = |name, x, low, high| within("doppler", name, x, low, high);
        self.at.iter().try_for_each(|x| within("at", *x, -10.0, 10.0))?;
        within("scale", self.scale, 0.0, 0.5)?;
        within("sigma", self.sigma, 0.0, 10.0)?;
        within("rate", self.rate, 1e-3, 100.0)?;
        within("reach[0]", self.reach[0], 0.0, 100.0)?;
        within("reach[1]", self.reach[1], self.reach[0], 1e4)?;
        within("latency", self.latency, 0.0, 60.0)?;
        within("dropouts", self.dropouts, 0.0, 1.0)
    }

    /// The velocities over ground up to `until` (s), in the body frame (m/s).
    pub(crate) fn readings(
        &self,
        track: &Track,
        scene: &Scene,
        until: f64,
        seeds: (u64, u64),
    ) -> Vec<TimedReading<Vector3<f64>>> {
        let scale = 1.0 + self.scale * Stream::new(seeds.0, seeds.1, u64::MAX, Purpose::Doppler).normal();
        let reading = |k: u64| {
            let time = k as f64 / self.rate;
            let mut stream = Stream::new(seeds.0, seeds.1, k, Purpose::Doppler);
            let state = track.at(time);
            let noise = stream.normal3(self.sigma);
            let (sine, cosine) = libm::sincos(BEAM_DEG.to_radians());
            let at = Vector3::from(self.at);
            let from = state.world_from_body.translation() + state.world_from_body.rotation() * at;
            let beams = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[x, y]: [f64; 2]| {
                let slant = sine * std::f64::consts::FRAC_1_SQRT_2;
                let along = state.world_from_body.rotation() * Vector3::new(x * slant, y * slant, cosine);
                let luck = stream.unit() < ON_STRUCTURE;
                let Some(length) = scene.hit(&from, &along) else { return false };
                let on_seabed = scene.seabed.hit(&from, &along).is_some_and(|t| t <= length);
                length >= self.reach[0] && length <= self.reach[1] && (on_seabed || luck)
            });
            let locked = beams.iter().filter(|b| **b).count() >= 3;
            let lost = stream.unit() < self.dropouts;
            let turning = state.motion.fixed_rows::<3>(0).into_owned();
            let value = (state.motion.fixed_rows::<3>(3) + turning.cross(&at)) * scale + noise;
            (locked && !lost).then_some(TimedReading { time, arrival: time + self.latency, value })
        };
        (0..=(until * self.rate) as u64).filter_map(reading).collect()
    }
}
