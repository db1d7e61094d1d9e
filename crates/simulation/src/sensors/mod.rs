//! The navigation sensors: acoustic positions and ranges, Doppler velocity, angular rate and attitude, depth.
//!
//! Every reading is a function of seed, dive, device and reading number. An error that is constant over a dive is
//! sampled once. A reading has the time of its measurement and the time of its arrival.

mod acoustic;
mod attitude;
mod depth;
mod doppler;
mod fault;
mod lbl;
mod prior;
mod reading;
mod trilateration;

use nalgebra::Vector3;
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

pub use acoustic::Acoustic;
pub use attitude::{AttitudeReading, AttitudeSensor};
pub use depth::DepthGauge;
pub use doppler::Doppler;
pub use fault::{DeviceFault, FaultKind, FaultyDevice};
pub use lbl::{Lbl, Ranges};
pub(crate) use prior::{SensorNavigation, SensorPrior};
pub use reading::TimedReading;

/// An acoustic position of the transponder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AcousticFix {
    /// North, east, down (m).
    pub at: Vector3<f64>,
    /// Reported standard deviation of each axis (m), outliers excluded.
    pub sigma: f64,
}

/// A position from the ranges to transponders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LblFix {
    /// North, east, down of the interrogator (m).
    pub at: Vector3<f64>,
    /// Reported standard deviation of each axis (m).
    pub sigma: Vector3<f64>,
}

/// All readings of the navigation sensors during a dive, each list in order of measurement.
///
/// A reading may be used from its arrival on. The lists contain errors, latency, losses and faults, but no truth.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Positions from USBL.
    pub acoustic: Vec<TimedReading<AcousticFix>>,
    /// Ranges to transponders, and the positions computed from them and the depth.
    pub lbl: Vec<TimedReading<(Ranges, Option<LblFix>)>>,
    /// Velocities over ground of the Doppler log, in the body frame (m/s).
    pub doppler: Vec<TimedReading<Vector3<f64>>>,
    /// Angular rates (rad/s, body frame) and attitudes.
    pub attitude: Vec<TimedReading<AttitudeReading>>,
    /// Depths of the gauge (m).
    pub depth: Vec<TimedReading<f64>>,
}

/// The navigation sensors of the vehicle.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sensors {
    /// USBL positioning from a ship.
    pub acoustic: Acoustic,
    /// LBL positioning among transponders on the seabed.
    pub lbl: Lbl,
    /// Doppler velocity log.
    pub doppler: Doppler,
    /// Gyro with attitude solution.
    pub attitude: AttitudeSensor,
    /// Depth gauge.
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

#[cfg(test)]
mod tests;
