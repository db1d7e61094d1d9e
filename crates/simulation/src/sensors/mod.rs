//! The vehicle's navigation sensors: acoustic positions and ranges, Doppler velocity, rate and attitude, depth.
//!
//! Every reading is a function of (seed, dive, device, number) alone; what a device has wrong for a whole
//! dive is drawn once. A reading has the time of what it measures and the time at which it is there.

mod acoustic;
mod attitude;
mod depth;
mod doppler;
mod fault;
mod lbl;
mod prior;
mod trilateration;

use nalgebra::Vector3;
use seafix_component::in_range;
use serde::{Deserialize, Serialize};

pub use acoustic::Acoustic;
pub use attitude::{AttitudeReading, AttitudeSensor};
pub use depth::DepthGauge;
pub use doppler::Doppler;
pub use fault::{DeviceFault, FaultKind, FaultyDevice};
pub use lbl::{Lbl, Ranges};
pub(crate) use prior::{SensorNavigation, SensorPrior};

/// The speed of sound (m/s).
const SOUND: f64 = 1500.0;

/// A reading of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedReading<V> {
    /// The time of what it measures (s).
    pub time: f64,
    /// When it is there to be used (s).
    pub arrival: f64,
    /// What it says.
    pub value: V,
}

/// An acoustic position of the transponder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AcousticFix {
    /// North, east, down (m).
    pub at: Vector3<f64>,
    /// What the sensor says about it: standard deviation of each axis (m), outliers apart.
    pub sigma: f64,
}

/// A position by the ranges to transponders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LblFix {
    /// North, east, down of the place that asks (m).
    pub at: Vector3<f64>,
    /// What it says about itself: standard deviation of each axis (m).
    pub sigma: Vector3<f64>,
}

/// Everything that the navigation sensors say during a dive, each in order of what it measured. A reading may be
/// used from its arrival on; errors, latency, losses and faults are in it, truth is not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Position from USBL.
    pub acoustic: Vec<TimedReading<AcousticFix>>,
    /// Ranges to transponders, and the position that they give with the depth.
    pub lbl: Vec<TimedReading<(Ranges, Option<LblFix>)>>,
    /// Velocity over ground of the log's place, body frame (m/s).
    pub doppler: Vec<TimedReading<Vector3<f64>>>,
    /// Rate of turn (rad/s, body frame) and attitude.
    pub attitude: Vec<TimedReading<AttitudeReading>>,
    /// Depth of the gauge (m).
    pub depth: Vec<TimedReading<f64>>,
}

/// The navigation sensors.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sensors {
    /// Position from a ship's transceiver.
    pub acoustic: Acoustic,
    /// Position among transponders on the bed.
    pub lbl: Lbl,
    /// Velocity over ground.
    pub doppler: Doppler,
    /// Rate of turn and attitude.
    pub attitude: AttitudeSensor,
    /// Depth.
    pub depth: DepthGauge,
}

impl Sensors {
    pub(crate) fn check(&self) -> Result<(), String> {
        self.acoustic.check()?;
        self.lbl.check()?;
        self.doppler.check()?;
        self.attitude.check()?;
        self.depth.check()
    }
}

/// Whether a number lies within its bounds, for a sensor's setting.
fn within(sensor: &str, name: &str, x: f64, low: f64, high: f64) -> Result<(), String> {
    in_range(x >= low && x <= high, &format!("sensors.{sensor}.{name}"), x, &format!("a number from {low} to {high}"))
}

/// What a fault can do to a value.
pub(crate) trait Value: Copy {
    /// Any value at all.
    fn garbage(stream: &mut crate::stream::Stream) -> Self;
    /// The value, off by a step that looks plausible.
    fn wrong(self) -> Self;
}

impl Value for Vector3<f64> {
    fn garbage(stream: &mut crate::stream::Stream) -> Self {
        stream.normal3(1e3)
    }

    fn wrong(self) -> Self {
        self * 1.5 + Self::new(2.0, -1.0, 0.5)
    }
}

impl Value for f64 {
    fn garbage(stream: &mut crate::stream::Stream) -> Self {
        1e3 * stream.normal()
    }

    fn wrong(self) -> Self {
        1.1 * self + 1.0
    }
}

#[cfg(test)]
mod tests;
