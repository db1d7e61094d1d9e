//! The readings of one device, in order of time.

use nalgebra::{Matrix3, Vector3};

use crate::Reading;

/// A device as heard so far. Between two readings its value is on the line between them, beyond them the nearest one's.
#[derive(Debug, Clone, Default)]
pub(super) struct Signal {
    readings: Vec<Reading>,
}

/// The value of a device at a time, and how far off it may be.
pub(super) struct Value {
    pub(super) at: Vector3<f64>,
    /// What the noise of the readings adds to the covariance of the value's integral (a second).
    pub(super) noise: Matrix3<f64>,
    /// What a value that wanders by one unit a root of a second adds to it, an axis (a second).
    pub(super) wander: f64,
    /// Whether it is the last reading's, held: those to come will say what it was.
    pub(super) held: bool,
}

impl Signal {
    /// Takes a reading in its place in time. One of an instant that has one already is left, and one that repeats its
    /// neighbour's noise bit for bit: the device says nothing new.
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

    /// Forgets what is not needed from `stamp_ns` on: all but the last reading before it.
    pub(super) fn forget(&mut self, stamp_ns: u64) {
        let place = self.readings.partition_point(|reading| reading.stamp_ns <= stamp_ns);
        self.readings.drain(..place.saturating_sub(1));
    }

    /// The stamp of the last reading.
    pub(super) fn latest(&self) -> Option<u64> {
        self.readings.last().map(|reading| reading.stamp_ns)
    }

    /// Stamps within a stretch, its ends left out.
    pub(super) fn within(&self, from: u64, to: u64) -> impl Iterator<Item = u64> {
        let stamps = self.readings.iter().map(|reading| reading.stamp_ns);
        stamps.filter(move |stamp| (from + 1..to).contains(stamp))
    }

    /// The longest time (s) between `from` and `to` that lies between two successive readings, or before the first or
    /// behind the last of them.
    pub(super) fn silence(&self, from: u64, to: u64) -> f64 {
        let around = self.readings.partition_point(|reading| reading.stamp_ns <= from);
        let first = around.checked_sub(1).map_or(from, |before| self.readings[before].stamp_ns);
        let signals = self.readings[around..].iter().map(|reading| reading.stamp_ns).take_while(|stamp| *stamp < to);
        let (longest, last) = signals.fold((0, first), |(longest, last), stamp| (longest.max(stamp - last), stamp));
        // What follows `to` may say how it went on until there.
        let after = self.readings.iter().map(|reading| reading.stamp_ns).find(|stamp| *stamp >= to).unwrap_or(to);
        seconds(0, longest.max(after - last))
    }

    /// The value half-way between two times; `None` before anything was heard.
    ///
    /// Between readings g seconds apart each counts from half-way to half-way: noise Σ g a second. A value that wanders
    /// (a Wiener process tied to its readings) errs in its integral over g by g³/12, so by g²/12 a second. One that is
    /// held for τ errs by Σ τ² and τ³/3, so by 2 Σ τ and τ² a second.
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

/// From one stamp to a later one (s).
pub(super) fn seconds(from: u64, to: u64) -> f64 {
    to.saturating_sub(from) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Device;

    fn said(stamp_ns: u64, x: f64) -> Reading {
        let covariance = Matrix3::identity() * 1e-6;
        Reading { device: Device::Doppler, stamp_ns, value: Vector3::new(x, 0.0, 0.0), covariance }
    }

    fn signal(all: &[(u64, f64)]) -> Signal {
        let mut signal = Signal::default();
        all.iter().for_each(|(stamp, x)| signal.insert(said(*stamp, *x)));
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
