//! Long-baseline (LBL) positioning: ranges to transponders on the seabed.

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

use super::reading::{SOUND, TimedReading, Value, within};
use crate::{
    stream::{Purpose, Stream},
    vehicle::Track,
};

/// Maximum number of transponders.
const MAX: usize = 8;
/// Maximum lengthening of a range by an echo, as a fraction of the range.
const ECHO: f64 = 0.1;

/// Long-baseline ranging: half of the round-trip time between vehicle and transponder gives a range.
///
/// A range is |p − t|·(1 + s) + noise. The true transponder position t differs from its surveyed position by an error
/// of standard deviation `survey`; s is the relative error of the speed of sound. Both stay the same for the dive.
/// Outliers are echoes, which are always too long. The vehicle's motion during the travel time is neglected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Lbl {
    /// Surveyed positions of the transponders: north, east, down (m). Give three to eight; an empty list disables LBL.
    pub transponders: Vec<[f64; 3]>,
    /// Standard deviation of each surveyed coordinate (m), from 0 to 100.
    pub survey: f64,
    /// Position of the interrogator in the body frame (m), from −10 to 10 each.
    pub at: [f64; 3],
    /// Standard deviation of a range (m), from 0 to 100.
    pub sigma: f64,
    /// Standard deviation of the relative error of the speed of sound, from 0 to 0.1.
    pub sound: f64,
    /// Interrogation rate (Hz), from 0.001 to 100.
    pub rate: f64,
    /// Fraction of replies that are echoes, from 0 to 1; an echo lengthens a range by up to 10 %.
    pub outliers: f64,
    /// Fraction of replies that are lost, from 0 to 1.
    pub dropouts: f64,
}

impl Default for Lbl {
    fn default() -> Self {
        Self {
            transponders: Vec::new(),
            survey: 0.05,
            at: [0.0; 3],
            sigma: 0.1,
            sound: 0.0005,
            rate: 0.5,
            outliers: 0.02,
            dropouts: 0.05,
        }
    }
}

/// The ranges of one interrogation (m), in the order of the transponders; `None` for a lost reply.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ranges(pub [Option<f64>; MAX]);

impl Value for Ranges {
    fn garbage(stream: &mut Stream) -> Self {
        Self([(); MAX].map(|()| Some((1e3 * stream.normal()).abs())))
    }

    fn wrong(self) -> Self {
        Self(self.0.map(|range| range.map(|r| 1.1 * r + 1.0)))
    }
}

impl Lbl {
    pub(super) fn check(&self) -> Result<(), String> {
        let within = |name, x, low, high| within("lbl", name, x, low, high);
        let n = self.transponders.len();
        in_range(n == 0 || (3..=MAX).contains(&n), "sensors.lbl.transponders", n, "3 to 8 positions, or none")?;
        self.transponders.iter().flatten().try_for_each(|x| within("transponders", *x, -1e4, 1e4))?;
        let distinct = |k: usize| {
            let away = |j: &[f64; 3]| (Vector3::from(*j) - Vector3::from(self.transponders[k])).norm();
            self.transponders[..k].iter().all(|j| away(j) > 1.0)
        };
        let close = (0..n).find(|k| !distinct(*k));
        let remedy = "a position more than 1 m from the others";
        let name = format!("sensors.lbl.transponders[{}]", close.unwrap_or(0));
        in_range(close.is_none(), &name, format!("{:?}", close.map(|k| self.transponders[k])), remedy)?;
        within("survey", self.survey, 0.0, 100.0)?;
        self.at.iter().try_for_each(|x| within("at", *x, -10.0, 10.0))?;
        within("sigma", self.sigma, 0.0, 100.0)?;
        within("sound", self.sound, 0.0, 0.1)?;
        within("rate", self.rate, 1e-3, 100.0)?;
        within("outliers", self.outliers, 0.0, 1.0)?;
        within("dropouts", self.dropouts, 0.0, 1.0)
    }

    /// The replies to the interrogations up to `until` (s).
    pub(crate) fn answers(&self, track: &Track, until: f64, seeds: (u64, u64)) -> Vec<TimedReading<Ranges>> {
        if self.transponders.is_empty() {
            return Vec::new();
        }
        let mut dive = Stream::new(seeds.0, seeds.1, u64::MAX, Purpose::Transponders);
        let sound = 1.0 + self.sound * dive.normal();
        let places: Vec<_> = self.transponders.iter().map(|t| Vector3::from(*t) + dive.normal3(self.survey)).collect();
        let ask = |k: u64| {
            let time = k as f64 / self.rate;
            let mut stream = Stream::new(seeds.0, seeds.1, k, Purpose::Transponders);
            let world_from_body = track.at(time).world_from_body;
            let from = world_from_body.translation() + world_from_body.rotation() * Vector3::from(self.at);
            let (mut ranges, mut longest) = (Ranges::default(), 0.0_f64);
            for (range, place) in ranges.0.iter_mut().zip(&places) {
                let true_range = (from - place).norm();
                longest = longest.max(true_range);
                let noise = self.sigma * stream.normal();
                let (lost, echo) = (stream.unit() < self.dropouts, stream.unit() < self.outliers);
                let longer = if echo { 1.0 + ECHO * stream.unit() } else { 1.0 };
                *range = (!lost).then_some((true_range * sound * longer + noise).max(0.0));
            }
            TimedReading { time, arrival: time + 2.0 * longest / SOUND, value: ranges }
        };
        (0..=(until * self.rate) as u64).map(ask).collect()
    }
}
