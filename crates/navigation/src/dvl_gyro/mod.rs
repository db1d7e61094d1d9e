//! Dead reckoning without images.

mod dead_reckoning;
mod integral;
mod signal;

use seafix_component::{Component, in_range};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use crate::{Odometry, OdometrySession};
use dead_reckoning::DeadReckoning;

/// Dead reckoning by a Doppler velocity log and a gyro: what a vehicle without cameras goes by.
///
/// The body turns by the gyro's rate ω and moves by the log's velocity v: over a stretch h between two successive readings
/// of either, both half-way on the line between theirs,
///
/// T ← T · Exp(h (ω, v − ω × l)), l the log's place in the body,
///
/// which errs by h². Readings may come late; they are put in order of time, and the motion that was told until then by
/// holding the last ones is put right with the next pair. Images are not looked at.
///
/// The covariance has the noise of the readings, what velocity and rate may do between them, and, as errors that
/// [last](crate::CorrelatedError), the log's scale and the gyro's bias (an Ornstein–Uhlenbeck process).
///
/// A device that is silent for more than `max-gap`, or says only what no vehicle does, breaks the segment.
///
/// Source: Groves, *Principles of GNSS, inertial, and multisensor integrated navigation systems*, 2013, ch. 5 and 6; Schmidt,
/// *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DvlGyro {
    /// Where the Doppler log sits in the vehicle: body frame (m).
    pub at: [f64; 3],
    /// Standard deviation of the log's scale error (relative).
    pub scale: f64,
    /// Standard deviation of the gyro's bias, each axis (degrees/h).
    pub instability: f64,
    /// Time constant of the bias (s).
    pub tau: f64,
    /// How far the velocity wanders in a second in which nothing is heard, each axis (m/s a root of a second).
    pub unsteady: f64,
    /// The same of the rate of turn (degrees/s a root of a second).
    pub unsteady_turn_deg: f64,
    /// A longer silence of either device breaks the segment, and a reading that comes later is of no use (s).
    pub max_gap: f64,
    /// A faster velocity is not believed (m/s).
    pub max_speed: f64,
    /// A faster turn is not believed (degrees/s).
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
    const SUMMARY: &'static str = "dead reckoning by Doppler log and gyro, without images";
    const SOURCE: &'static str = "Groves, Principles of GNSS, inertial, and multisensor integrated navigation systems, \
                                  2013; errors that last: Schmidt, Application of state-space methods to navigation \
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

impl Odometry for DvlGyro {
    fn listens(&self) -> bool {
        true
    }

    fn begin<'a>(
        &'a self,
        _: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
        _: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        Box::new(DeadReckoning::new(self, body_from_camera))
    }
}
