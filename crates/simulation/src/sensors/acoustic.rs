//! Acoustic positioning from a ship: USBL.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{SOUND, TimedReading, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// Outliers err by up to this share of the slant range.
const OUTLIER: f64 = 0.1;

/// Acoustic positions: each world axis errs by σ = `sigma` + `range_fraction`·(slant range). USBL has a share (0.5 %
/// is usual, 0.1 to 2 % are found); a sigma (0.1 to 0.3 m) and no share stand for an LBL that is not looked into.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acoustic {
    /// Where the transceiver is: north, east, down (m).
    pub from: [f64; 3],
    /// Where its transponder sits in the vehicle: body frame (m).
    pub at: [f64; 3],
    /// Part of σ that grows with the slant range.
    pub range_fraction: f64,
    /// Part of σ that does not (m).
    pub sigma: f64,
    /// Fixes a second.
    pub rate: f64,
    /// Share of fixes that are far off.
    pub outliers: f64,
    /// Share of fixes that never come.
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

    /// The standard deviation of each axis at a slant range (m).
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
