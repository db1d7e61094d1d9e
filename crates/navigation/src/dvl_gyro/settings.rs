//! Settings of dead reckoning.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

/// Dead reckoning by a Doppler velocity log (DVL) and a gyro.
///
/// The body rotates with the gyro's angular rate ω and moves with the log's velocity v. Over an interval h between two
/// successive readings of either device, with both values interpolated at its middle,
///
/// T ← T · Exp(h (ω, v − ω × l)), with l the position of the log in the body frame.
///
/// The global error of this midpoint rule is of order h². Late readings are sorted in by time: the motion that was
/// extrapolated from the last readings is corrected with the next pair. Images are not used.
///
/// The covariance includes the noise of the readings, random changes of velocity and rate between them and, as
/// [correlated errors](crate::CorrelatedError), the scale error of the log and the bias of the gyro (an
/// Ornstein–Uhlenbeck process).
///
/// The segment breaks if a device is silent for more than `max-gap` or gives only impossible values.
///
/// Source: Groves, *Principles of GNSS, inertial, and multisensor integrated navigation systems*, 2013, ch. 5 and 6;
/// Schmidt, *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DvlGyro {
    /// Position of the Doppler log in the vehicle: body frame (m).
    pub at: [f64; 3],
    /// Standard deviation of the log's scale error (relative), 0 to 0.5.
    pub scale: f64,
    /// Standard deviation of the gyro's bias for each axis (degrees/h).
    pub instability: f64,
    /// Time constant of the bias (s).
    pub tau: f64,
    /// Random-walk density of the velocity between readings, for each axis (m/s/√s).
    pub unsteady: f64,
    /// Random-walk density of the angular rate between readings, for each axis (degrees/s/√s).
    pub unsteady_turn_deg: f64,
    /// Maximum silence of a device (s); a longer one breaks the segment, and a reading delayed by more is ignored.
    pub max_gap: f64,
    /// Maximum speed (m/s); a faster reading is rejected as an outlier.
    pub max_speed: f64,
    /// Maximum angular rate (degrees/s); a faster reading is rejected as an outlier.
    pub max_turn_deg: f64,
}

impl Default for DvlGyro {
    fn default() -> Self {
        Self {
            at: [0.0; 3],
            scale: 0.002,
            instability: 5.0,
            tau: 300.0,
            unsteady: 0.01,
            unsteady_turn_deg: 0.2,
            max_gap: 2.0,
            max_speed: 5.0,
            max_turn_deg: 90.0,
        }
    }
}

impl Component for DvlGyro {
    const NAME: &'static str = "dvl-gyro";
    const SUMMARY: &'static str = "dead reckoning by Doppler velocity log and gyro, without images";
    const SOURCE: &'static str = "Groves, Principles of GNSS, inertial, and multisensor integrated navigation systems, \
                                  2013; correlated errors: Schmidt, Application of state-space methods to navigation \
                                  problems, 1966";

    fn check(&self) -> Result<(), String> {
        let from = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, name, x, &format!("a number from {low} to {high}"))
        };
        self.at.iter().try_for_each(|x| from("at", *x, -100.0, 100.0))?;
        from("scale", self.scale, 0.0, 0.5)?;
        from("instability", self.instability, 0.0, 1e6)?;
        from("tau", self.tau, 1e-3, 1e9)?;
        from("unsteady", self.unsteady, 0.0, 100.0)?;
        from("unsteady-turn-deg", self.unsteady_turn_deg, 0.0, 1e4)?;
        from("max-gap", self.max_gap, 1e-3, 3600.0)?;
        from("max-speed", self.max_speed, 1e-3, 1e3)?;
        from("max-turn-deg", self.max_turn_deg, 1e-3, 1e5)
    }
}
