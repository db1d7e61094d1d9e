//! Rate gyro and attitude solution.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Settings;
use seafix_geometry::so3;
use serde::{Deserialize, Serialize};

use super::reading::{TimedReading, Value, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// A gyro with its attitude solution.
///
/// The rate is ω + bias + white noise of density `random_walk`. The bias is an Ornstein–Uhlenbeck process of standard
/// deviation `instability` and time constant `tau`. The attitude has a heading error and a level error that stay the
/// same for the dive, and white noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct AttitudeSensor {
    /// Standard deviation of the heading error, constant over a dive (degrees), from 0 to 180.
    pub heading_deg: f64,
    /// Standard deviation of the roll and pitch errors, constant over a dive (degrees), from 0 to 90.
    pub level_deg: f64,
    /// Standard deviation of the white attitude noise about each axis (degrees), from 0 to 90.
    pub sigma_deg: f64,
    /// Angle random walk (degrees/√h), from 0 to 1000.
    pub random_walk: f64,
    /// Standard deviation of the rate bias (degrees/h), from 0 to 1 000 000.
    pub instability: f64,
    /// Time constant of the bias (s), from 0.001 to 1 000 000.
    pub tau: f64,
    /// Reading rate (Hz), from 0.001 to 1000.
    pub rate: f64,
    /// Delay between measurement and arrival of a reading (s), from 0 to 60.
    pub latency: f64,
    /// Fraction of readings that are lost, from 0 to 1.
    pub dropouts: f64,
}

impl Default for AttitudeSensor {
    fn default() -> Self {
        Self {
            heading_deg: 0.5,
            level_deg: 0.1,
            sigma_deg: 0.05,
            random_walk: 0.15,
            instability: 5.0,
            tau: 300.0,
            rate: 10.0,
            latency: 0.01,
            dropouts: 0.0,
        }
    }
}

/// One reading of rate and attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeReading {
    /// Angular velocity in the body frame (rad/s).
    pub rate: Vector3<f64>,
    /// The vehicle's attitude.
    pub world_from_body: UnitQuaternion<f64>,
}

impl Value for AttitudeReading {
    fn garbage(stream: &mut Stream) -> Self {
        let turn = stream.normal3(2.0);
        Self { rate: stream.normal3(10.0), world_from_body: so3::exp(&turn) }
    }

    fn wrong(self) -> Self {
        let turn = so3::exp(&Vector3::new(0.05, -0.05, 0.3));
        Self { rate: self.rate * 1.2, world_from_body: turn * self.world_from_body }
    }
}

impl AttitudeSensor {
    pub(super) fn check(&self) -> Result<(), String> {
        let within = |name, x, low, high| within("attitude", name, x, low, high);
        within("heading-deg", self.heading_deg, 0.0, 180.0)?;
        within("level-deg", self.level_deg, 0.0, 90.0)?;
        within("sigma-deg", self.sigma_deg, 0.0, 90.0)?;
        within("random-walk", self.random_walk, 0.0, 1e3)?;
        within("instability", self.instability, 0.0, 1e6)?;
        within("tau", self.tau, 1e-3, 1e6)?;
        within("rate", self.rate, 1e-3, 1e3)?;
        within("latency", self.latency, 0.0, 60.0)?;
        within("dropouts", self.dropouts, 0.0, 1.0)
    }

    /// Standard deviation of the white rate noise on each axis (rad/s): the random walk over one reading interval.
    pub fn rate_sigma(&self) -> f64 {
        self.random_walk.to_radians() / 60.0 * self.rate.sqrt()
    }

    /// The readings up to `until` (s).
    pub(crate) fn readings(&self, track: &Track, until: f64, seeds: (u64, u64)) -> Vec<TimedReading<AttitudeReading>> {
        let mut dive = Stream::new(seeds.0, seeds.1, u64::MAX, Purpose::Gyro);
        let level = self.level_deg.to_radians();
        let offset =
            Vector3::new(level * dive.normal(), level * dive.normal(), self.heading_deg.to_radians() * dive.normal());
        let spread = self.instability.to_radians() / 3600.0;
        let mut bias = dive.normal3(spread);
        let dt = 1.0 / self.rate;
        let keep = libm::exp(-dt / self.tau);
        let white = self.rate_sigma();
        let reading = |k: u64| {
            let time = k as f64 * dt;
            let mut stream = Stream::new(seeds.0, seeds.1, k, Purpose::Gyro);
            let state = track.at(time);
            let rate = state.motion.fixed_rows::<3>(0).into_owned() + bias + stream.normal3(white);
            let noise = stream.normal3(self.sigma_deg.to_radians());
            bias = bias * keep + stream.normal3(spread * (1.0 - keep * keep).sqrt());
            let lost = stream.unit() < self.dropouts;
            let world_from_body = so3::exp(&offset) * state.world_from_body.rotation() * so3::exp(&noise);
            let value = AttitudeReading { rate, world_from_body };
            (!lost).then_some(TimedReading { time, arrival: time + self.latency, value })
        };
        (0..=(until * self.rate) as u64).filter_map(reading).collect()
    }
}
