//! Rate gyro and attitude.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::so3;
use serde::{Deserialize, Serialize};

use super::{TimedReading, Value, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// A gyro with its attitude solution.
///
/// Rate: ω + bias + white noise of density `random_walk`; the bias is an Ornstein–Uhlenbeck process of
/// standard deviation `instability`. Attitude: a heading error of the dive, and white noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct AttitudeSensor {
    /// Standard deviation of the heading error of the dive (degrees).
    pub heading_deg: f64,
    /// Standard deviation of roll's and pitch's errors of the dive (degrees).
    pub level_deg: f64,
    /// Standard deviation of the attitude's noise, each axis (degrees).
    pub sigma_deg: f64,
    /// Angle random walk (degrees/√h).
    pub random_walk: f64,
    /// Standard deviation of the rate's bias (degrees/h).
    pub instability: f64,
    /// Time constant of the bias (s).
    pub tau: f64,
    /// Readings a second.
    pub rate: f64,
    /// How late a reading comes (s).
    pub latency: f64,
    /// Share of readings that never come.
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

/// One reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeReading {
    /// Rate of turn, body frame (rad/s).
    pub rate: Vector3<f64>,
    /// The body in the world.
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

    /// Standard deviation of the white noise of a reading's rate, each axis (rad/s): the random walk over a reading's time.
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
