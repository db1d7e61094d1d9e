//! Devices that fail.

use seafix_component::in_range;
use serde::{Deserialize, Serialize};

use super::{TimedReading, Value};
use crate::stream::{Purpose, Stream};

/// Of slow devices only every so many-th reading comes.
const SLOW: usize = 5;

/// The devices that can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultyDevice {
    /// Both cameras.
    Images,
    /// The acoustic positions.
    Acoustic,
    /// The ranges to transponders.
    Lbl,
    /// The Doppler log.
    Doppler,
    /// Gyro and attitude.
    Attitude,
    /// The depth gauge.
    Depth,
}

/// How a device fails, in the words of PX4's failure injection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// Nothing comes; images are black.
    Off,
    /// The last value comes again and again.
    Stuck,
    /// Anything comes.
    Garbage,
    /// Plausible values that are false; the two images have changed places.
    Wrong,
    /// A fifth of the readings comes; images stand still for five frames.
    Slow,
    /// Readings come `amount` seconds late; images show what was then.
    Delayed,
    /// Each reading is lost with the probability `amount`.
    Intermittent,
}

/// A device that fails for a while.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct DeviceFault {
    /// The device.
    pub device: FaultyDevice,
    /// How it fails.
    pub kind: FaultKind,
    /// When it begins (s).
    pub from: f64,
    /// When it ends (s), not before `from`; at `from` it never acts.
    pub to: f64,
    /// Seconds of delay, or the probability of a loss.
    #[serde(default = "half")]
    pub amount: f64,
}

fn half() -> f64 {
    0.5
}

impl FaultKind {
    /// Whether a fault of this kind can be from one time to another (s) with an amount; `index` is its place among `faults`.
    ///
    /// # Errors
    /// The first number outside its range: `name = value; give range`.
    pub fn check(self, (from, to): (f64, f64), amount: f64, index: usize) -> Result<(), String> {
        let name = |key: &str| format!("faults[{index}].{key}");
        in_range(from >= 0.0 && from.is_finite(), &name("from"), from, "seconds, zero or more")?;
        in_range(to >= from && to.is_finite(), &name("to"), to, "seconds, not before `from`")?;
        let max = if self == FaultKind::Intermittent { 1.0 } else { 1e3 };
        let range = format!("a number from 0 to {max}");
        in_range(amount >= 0.0 && amount <= max, &name("amount"), amount, &range)
    }
}

impl DeviceFault {
    pub(crate) fn check(&self, index: usize) -> Result<(), String> {
        self.kind.check((self.from, self.to), self.amount, index)
    }

    /// Whether it acts at a time (s).
    pub(crate) fn acts(&self, time: f64) -> bool {
        time >= self.from && time < self.to
    }
}

/// Readings of a device, failed as `faults` say.
pub(super) fn failed<V: Value>(
    readings: Vec<TimedReading<V>>,
    device: FaultyDevice,
    faults: &[DeviceFault],
    seeds: (u64, u64),
) -> Vec<TimedReading<V>> {
    faults.iter().filter(|fault| fault.device == device).enumerate().fold(readings, |readings, (n, fault)| {
        let mut last = None;
        let mut out = Vec::with_capacity(readings.len());
        for (k, reading) in readings.into_iter().enumerate() {
            if !fault.acts(reading.time) {
                last = Some(reading.value);
                out.push(reading);
                continue;
            }
            let mut stream = Stream::new(seeds.0, seeds.1 ^ ((n as u64 + 1) << 48), k as u64, Purpose::Faults);
            let with = |value| Some(TimedReading { value, ..reading });
            out.extend(match fault.kind {
                FaultKind::Off => None,
                FaultKind::Stuck => with(*last.get_or_insert(reading.value)),
                FaultKind::Garbage => with(V::garbage(&mut stream)),
                FaultKind::Wrong => with(reading.value.wrong()),
                FaultKind::Slow => (k % SLOW == 0).then_some(reading),
                FaultKind::Delayed => Some(TimedReading { arrival: reading.arrival + fault.amount, ..reading }),
                FaultKind::Intermittent => (stream.unit() >= fault.amount).then_some(reading),
            });
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings() -> Vec<TimedReading<f64>> {
        (0..100).map(|k| TimedReading { time: f64::from(k), arrival: f64::from(k), value: f64::from(k) }).collect()
    }

    fn fails(kind: FaultKind, amount: f64) -> Vec<TimedReading<f64>> {
        let fault = DeviceFault { device: FaultyDevice::Depth, kind, from: 20.0, to: 60.0, amount };
        failed(readings(), FaultyDevice::Depth, &[fault], (1, 0))
    }

    #[test]
    fn devices_fail_as_reported() {
        assert_eq!(fails(FaultKind::Off, 0.0).len(), 60);
        assert!(fails(FaultKind::Stuck, 0.0)[20..60].iter().all(|r| r.value == 19.0));
        assert!(fails(FaultKind::Garbage, 0.0)[20..60].iter().all(|r| r.value.fract() != 0.0));
        assert_eq!(fails(FaultKind::Wrong, 0.0)[30].value, 34.0);
        assert_eq!(fails(FaultKind::Slow, 0.0).len(), 68);
        assert_eq!(fails(FaultKind::Delayed, 2.5)[30].arrival, 32.5);
        assert!((70..90).contains(&fails(FaultKind::Intermittent, 0.5).len()));
    }

    #[test]
    fn a_fault_of_no_amount_or_no_time_is_none() {
        assert_eq!(fails(FaultKind::Delayed, 0.0), readings());
        assert_eq!(fails(FaultKind::Intermittent, 0.0), readings());
        let never = DeviceFault { device: FaultyDevice::Depth, kind: FaultKind::Off, from: 5.0, to: 5.0, amount: 1.0 };
        assert_eq!(failed(readings(), FaultyDevice::Depth, std::slice::from_ref(&never), (1, 0)), readings());
        assert_eq!(failed(readings(), FaultyDevice::Doppler, &[never], (1, 0)), readings());
    }
}
