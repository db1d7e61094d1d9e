//! The readings of one device, in order of time.

use nalgebra::{Matrix3, Vector3};

use crate::reading::Reading;

/// The signal of a device: linear interpolation between readings, constant extrapolation beyond them.
#[derive(Debug, Clone, Default)]
pub(super) struct Signal {
    readings: Vec<Reading>,
}

/// The value of a device at a time, with its noise.
pub(super) struct Value {
    pub(super) at: Vector3<f64>,
    /// Spectral density of the reading noise: its contribution to the covariance of the integral per second.
    pub(super) noise: Matrix3<f64>,
    /// Spectral density of the integral, for each axis, that a random walk of unit density contributes.
    pub(super) wander: f64,
    /// Whether the value is extrapolated from the last reading; later readings will correct it.
    pub(super) held: bool,
}

impl Signal {
    /// Inserts a reading in order of time.
    ///
    /// A second reading of the same instant is ignored. So is a noisy reading with the same value as its neighbour, bit
    /// for bit: the device repeats an old output.
    pub(super) fn insert(&mut self, reading: Reading) {
        let place = self.readings.partition_point(|other| other.stamp_ns < reading.stamp_ns);
        let next = self.readings.get(place);
        let before = place.checked_sub(1).map(|before| &self.readings[before]);
        let noisy = reading.covariance.trace() > 0.0;
        let repeats = |other: Option<&Reading>| noisy && other.is_some_and(|other| other.value == reading.value);
        if next.is_some_and(|next| next.stamp_ns == reading.stamp_ns) || repeats(before) || repeats(next) {
            return;
        }
        self.readings.insert(place, reading);
    }

    /// Drops the readings that are not needed from `stamp_ns` on: all but the last one before it.
    pub(super) fn forget(&mut self, stamp_ns: u64) {
        let place = self.readings.partition_point(|reading| reading.stamp_ns <= stamp_ns);
        self.readings.drain(..place.saturating_sub(1));
    }

    /// The stamp of the last reading.
    pub(super) fn latest(&self) -> Option<u64> {
        self.readings.last().map(|reading| reading.stamp_ns)
    }

    /// The stamps strictly between two times.
    pub(super) fn within(&self, from: u64, to: u64) -> impl Iterator<Item = u64> {
        let stamps = self.readings.iter().map(|reading| reading.stamp_ns);
        stamps.filter(move |stamp| (from + 1..to).contains(stamp))
    }

    /// The longest time (s) without a reading between `from` and `to`.
    ///
    /// The gaps before the first and after the last reading count as well.
    pub(super) fn silence(&self, from: u64, to: u64) -> f64 {
        let around = self.readings.partition_point(|reading| reading.stamp_ns <= from);
        let first = around.checked_sub(1).map_or(from, |before| self.readings[before].stamp_ns);
        let signals = self.readings[around..].iter().map(|reading| reading.stamp_ns).take_while(|stamp| *stamp < to);
        let (longest, last) = signals.fold((0, first), |(longest, last), stamp| (longest.max(stamp - last), stamp));
        // A reading after `to` bounds the last gap, because the value is interpolated up to it.
        let after = self.readings.iter().map(|reading| reading.stamp_ns).find(|stamp| *stamp >= to).unwrap_or(to);
        seconds(0, longest.max(after - last))
    }

    /// The value in the middle of two times; `None` without a reading.
    ///
    /// Between readings g seconds apart each reading counts from middle to middle: the noise density is Σ g. A random
    /// walk pinned at the readings (Brownian bridge) gives the integral over g a variance of g³/12, a density of g²/12.
    /// A value held for τ gives Σ τ² and τ³/3, densities of 2 Σ τ and τ².
    pub(super) fn midway(&self, from: u64, to: u64) -> Option<Value> {
        let middle = from + (to - from) / 2;
        let place = self.readings.partition_point(|reading| reading.stamp_ns <= middle);
        let before = place.checked_sub(1).map(|before| &self.readings[before]);
        let held = |reading: &Reading, tau: f64, held: bool| {
            Some(Value { at: reading.value, noise: reading.covariance * (2.0 * tau), wander: tau * tau, held })
        };
        match (before, self.readings.get(place)) {
            (None, None) => None,
            (None, Some(first)) => held(first, seconds(middle, first.stamp_ns), false),
            (Some(last), None) => held(last, seconds(last.stamp_ns, middle), true),
            (Some(before), Some(after)) => {
                let gap = seconds(before.stamp_ns, after.stamp_ns);
                let fraction = (seconds(before.stamp_ns, from) + 0.5 * seconds(from, to)) / gap;
                let noise = (before.covariance + after.covariance) * (0.5 * gap);
                Some(Value {
                    at: before.value.lerp(&after.value, fraction),
                    noise,
                    wander: gap * gap / 12.0,
                    held: false,
                })
            }
        }
    }
}

/// The time from one stamp to a later one (s).
pub(super) fn seconds(from: u64, to: u64) -> f64 {
    to.saturating_sub(from) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reading::Device;

    fn message(stamp_ns: u64, x: f64) -> Reading {
        let covariance = Matrix3::identity() * 1e-6;
        Reading { device: Device::Doppler, stamp_ns, value: Vector3::new(x, 0.0, 0.0), covariance }
    }

    fn signal(all: &[(u64, f64)]) -> Signal {
        let mut signal = Signal::default();
        all.iter().for_each(|(stamp, x)| signal.insert(message(*stamp, *x)));
        signal
    }

    #[test]
    fn late_readings_find_their_place_and_repeated_ones_none() {
        let signal = signal(&[(100, 1.0), (300, 3.0), (200, 2.0), (300, 9.0), (400, 3.0)]);
        assert_eq!(signal.within(0, 1000).collect::<Vec<_>>(), [100, 200, 300]);
        assert!((signal.midway(200, 300).unwrap().at.x - 2.5).abs() < 1e-12);
        assert_eq!((signal.midway(0, 50).unwrap().at.x, signal.midway(400, 500).unwrap().at.x), (1.0, 3.0));
    }

    #[test]
    fn silence_is_between_readings_and_at_the_ends() {
        let second = 1_000_000_000;
        let signal = signal(&[(second, 1.0), (2 * second, 2.0), (5 * second, 3.0)]);
        let silence = |from: u64, to: u64| signal.silence(from * second / 2, to * second / 2);
        assert_eq!((silence(2, 4), silence(2, 5), silence(5, 6)), (1.0, 3.0, 3.0));
        assert_eq!((silence(0, 2), silence(11, 14), silence(10, 13)), (1.0, 2.0, 1.5));
    }
}
