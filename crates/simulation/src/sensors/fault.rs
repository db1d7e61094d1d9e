//! Device faults.

use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

use super::reading::{TimedReading, Value};
use crate::stream::{Purpose, Stream};

/// Decimation of a slow device: one reading in this number arrives.
const SLOW: usize = 5;

/// The devices that can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
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

/// The kinds of fault, named as in PX4's failure injection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// No reading arrives; images are black.
    Off,
    /// The last reading before the fault is repeated; images repeat the first frame of the fault.
    Stuck,
    /// Random values arrive.
    Garbage,
    /// Plausible but false values arrive; left and right images are exchanged.
    Wrong,
    /// One reading in five arrives; one image in five is new.
    Slow,
    /// Readings arrive `amount` seconds late; images show the view of `amount` seconds ago.
    Delayed,
    /// Each reading is lost with the probability `amount`; a lost image is black.
    Intermittent,
}

/// A fault of one device over an interval of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct DeviceFault {
    /// The device.
    pub device: FaultyDevice,
    /// The kind of fault.
    pub kind: FaultKind,
    /// Start of the fault (s), at least 0.
    pub from: f64,
    /// End of the fault (s), excluded and not before `from`. An end equal to `from` disables the fault.
    pub to: f64,
    /// Delay (s), from 0 to 1000, or probability of a loss, from 0 to 1; other kinds ignore it.
    #[serde(default = "half")]
    pub amount: f64,
}

fn half() -> f64 {
    0.5
}

impl FaultKind {
    /// Checks the interval `(from, to)` (s) and the amount of a fault; `index` is its position in `faults`.
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

    /// Whether the fault is active at a time (s).
    pub(crate) fn acts(&self, time: f64) -> bool {
        time >= self.from && time < self.to
    }
}

/// The readings of a device after its faults.
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
