//! The pressure sensor.

use nalgebra::Vector3;
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use super::reading::{TimedReading, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// Depth from pressure, with a constant bias over a dive (tide, density) and white noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DepthGauge {
    /// Position of the sensor in the body frame (m), from −10 to 10 each.
    pub at: [f64; 3],
    /// Standard deviation of the bias (m), from 0 to 100.
    pub bias: f64,
    /// Standard deviation of the white noise (m), from 0 to 100.
    pub sigma: f64,
    /// Reading rate (Hz), from 0.001 to 1000.
    pub rate: f64,
    /// Delay between measurement and arrival of a reading (s), from 0 to 60.
    pub latency: f64,
    /// Fraction of readings that are lost, from 0 to 1.
    pub dropouts: f64,
}

impl Default for DepthGauge {
    fn default() -> Self {
        Self { at: [0.0; 3], bias: 0.1, sigma: 0.02, rate: 5.0, latency: 0.02, dropouts: 0.0 }
    }
}

impl DepthGauge {
    pub(super) fn check(&self) -> Result<(), String> {
        let within = |name, x, low, high| within("depth", name, x, low, high);
        self.at.iter().try_for_each(|x| within("at", *x, -10.0, 10.0))?;
        within("bias", self.bias, 0.0, 100.0)?;
        within("sigma", self.sigma, 0.0, 100.0)?;
        within("rate", self.rate, 1e-3, 1e3)?;
        within("latency", self.latency, 0.0, 60.0)?;
        within("dropouts", self.dropouts, 0.0, 1.0)
    }

    /// The depths up to `until` (s), in metres.
    pub(crate) fn readings(&self, track: &Track, until: f64, seeds: (u64, u64)) -> Vec<TimedReading<f64>> {
        let bias = self.bias * Stream::new(seeds.0, seeds.1, u64::MAX, Purpose::Depth).normal();
        let reading = |k: u64| {
            let time = k as f64 / self.rate;
            let mut stream = Stream::new(seeds.0, seeds.1, k, Purpose::Depth);
            let (noise, lost) = (self.sigma * stream.normal(), stream.unit() < self.dropouts);
            let world_from_body = track.at(time).world_from_body;
            let below = (world_from_body.rotation() * Vector3::from(self.at)).z;
            let value = world_from_body.translation().z + below + bias + noise;
            (!lost).then_some(TimedReading { time, arrival: time + self.latency, value })
        };
        (0..=(until * self.rate) as u64).filter_map(reading).collect()
    }
}
