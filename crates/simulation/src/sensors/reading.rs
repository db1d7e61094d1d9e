//! Readings of a sensor.

use nalgebra::Vector3;
use seafix_component::in_range;

use crate::stream::Stream;

/// The speed of sound (m/s).
pub(super) const SOUND: f64 = 1500.0;

/// A sensor reading with its times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedReading<V> {
    /// Time of the measurement (s).
    pub time: f64,
    /// Time of arrival (s); the reading is unknown before it.
    pub arrival: f64,
    /// The measured value.
    pub value: V,
}

/// Checks that a sensor's setting lies in its range.
pub(super) fn within(sensor: &str, name: &str, x: f64, low: f64, high: f64) -> Result<(), String> {
    in_range(x >= low && x <= high, &format!("sensors.{sensor}.{name}"), x, &format!("a number from {low} to {high}"))
}

/// A value that faults can replace.
pub(crate) trait Value: Copy {
    /// A random value.
    fn garbage(stream: &mut Stream) -> Self;
    /// The value with a plausible error.
    fn wrong(self) -> Self;
}

impl Value for Vector3<f64> {
    fn garbage(stream: &mut Stream) -> Self {
        stream.normal3(1e3)
    }

    fn wrong(self) -> Self {
        self * 1.5 + Self::new(2.0, -1.0, 0.5)
    }
}

impl Value for f64 {
    fn garbage(stream: &mut Stream) -> Self {
        1e3 * stream.normal()
    }

    fn wrong(self) -> Self {
        1.1 * self + 1.0
    }
}
