//! Ultra-short-baseline (USBL) positioning from a ship.

use nalgebra::Vector3;
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use super::reading::{SOUND, TimedReading, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// Maximum error of an outlier, as a fraction of the slant range.
const OUTLIER: f64 = 0.1;

/// Acoustic positions with the standard deviation σ = `sigma` + `range_fraction`·(slant range) on each world axis.
///
/// USBL has a range fraction (0.5 % is usual, published values go from 0.1 to 2 %). A `sigma` of 0.1 to 0.3 m without a
/// fraction stands for an LBL system of which only the positions are used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acoustic {
    /// Position of the ship's transceiver: north, east, down (m), from −100 000 to 100 000 each.
    pub from: [f64; 3],
    /// Position of the transponder in the body frame (m), from −10 to 10 each.
    pub at: [f64; 3],
    /// Growth of σ with the slant range, from 0 to 0.2. The default is a usual USBL.
    pub range_fraction: f64,
    /// Constant part of σ (m), from 0 to 100.
    pub sigma: f64,
    /// Fix rate (Hz), from 0.001 to 100.
    pub rate: f64,
    /// Fraction of fixes that are outliers, from 0 to 1; their error reaches 10 % of the slant range.
    pub outliers: f64,
    /// Fraction of fixes that are lost, from 0 to 1.
    pub dropouts: f64,
}

impl Default for Acoustic {
    fn default() -> Self {
        Self {
            from: [30.0, 20.0, 2.0],
            at: [0.0; 3],
            range_fraction: 0.005,
            sigma: 0.0,
            rate: 0.5,
            outliers: 0.05,
            dropouts: 0.05,
        }
    }
}

impl Acoustic {
    pub(super) fn check(&self) -> Result<(), String> {
        let within = |name, x, low, high| within("acoustic", name, x, low, high);
        self.from.iter().try_for_each(|x| within("from", *x, -1e5, 1e5))?;
        self.at.iter().try_for_each(|x| within("at", *x, -10.0, 10.0))?;
        within("range-fraction", self.range_fraction, 0.0, 0.2)?;
        within("sigma", self.sigma, 0.0, 100.0)?;
        within("rate", self.rate, 1e-3, 100.0)?;
        within("outliers", self.outliers, 0.0, 1.0)?;
        within("dropouts", self.dropouts, 0.0, 1.0)
    }

    /// Standard deviation of each axis at a slant range (m).
    pub(crate) fn spread(&self, range: f64) -> f64 {
        self.sigma + self.range_fraction * range
    }

    /// The fixes up to `until` (s): north, east, down (m).
    pub(crate) fn fixes(&self, track: &Track, until: f64, seeds: (u64, u64)) -> Vec<TimedReading<Vector3<f64>>> {
        let fix = |k: u64| {
            let time = k as f64 / self.rate;
            let mut stream = Stream::new(seeds.0, seeds.1, k, Purpose::Acoustics);
            let world_from_body = track.at(time).world_from_body;
            let at = world_from_body.translation() + world_from_body.rotation() * Vector3::from(self.at);
            let range = (at - Vector3::from(self.from)).norm();
            let error = stream.normal3(self.spread(range));
            let far = Vector3::from_fn(|_, _| stream.between(-1.0, 1.0)) * (OUTLIER * range);
            let (lost, off) = (stream.unit() < self.dropouts, stream.unit() < self.outliers);
            let value = at + error + if off { far } else { Vector3::zeros() };
            (!lost).then_some(TimedReading { time, arrival: time + 2.0 * range / SOUND, value })
        };
        (0..=(until * self.rate) as u64).filter_map(fix).collect()
    }
}
