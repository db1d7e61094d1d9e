//! Navigation sensor readings between frames.

use seafix_navigation::{Device, Reading};

/// A buffer of readings in the order of their arrival.
#[derive(Debug, Clone, Default)]
pub struct SensorBuffer {
    /// The time of arrival (ns) and the reading.
    arrived: Vec<(u64, Reading)>,
}

impl SensorBuffer {
    /// A buffer of readings with their arrivals, in any order.
    pub fn new(mut arrived: Vec<(u64, Reading)>) -> Self {
        // Readings that arrive together stay in the order of measurement.
        arrived.sort_by_key(|(arrival_ns, reading)| (*arrival_ns, reading.stamp_ns));
        Self { arrived }
    }

    /// Whether every device has a reading.
    pub fn is_complete(&self) -> bool {
        Device::ALL.iter().all(|device| self.arrived.iter().any(|(_, reading)| reading.device == *device))
    }

    /// The readings that arrive after the frame `before`, up to and including the frame `now`.
    pub fn between(&self, before: Option<u64>, now: u64) -> Vec<Reading> {
        let until = |stamp: u64| self.arrived.partition_point(|(arrival_ns, _)| *arrival_ns <= stamp);
        let reported = &self.arrived[before.map_or(0, until)..until(now)];
        reported.iter().map(|(_, reading)| *reading).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn every_reading_is_reported_once() {
        let reading = |stamp_ns| Reading {
            device: Device::Gyro,
            stamp_ns,
            value: Vector3::zeros(),
            covariance: Matrix3::zeros(),
        };
        let sensor_buffer =
            SensorBuffer::new(vec![(30, reading(10)), (12, reading(11)), (40, reading(38)), (30, reading(9))]);
        let reported =
            |before, now| sensor_buffer.between(before, now).iter().map(|one| one.stamp_ns).collect::<Vec<_>>();
        assert!(!sensor_buffer.is_complete());
        assert_eq!(reported(None, 12), [11]);
        assert_eq!(reported(Some(12), 30), [9, 10]);
        assert_eq!((reported(Some(30), 39), reported(Some(39), 40)), (vec![], vec![38]));
    }
}
