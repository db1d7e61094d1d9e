//! A mission: one simulated dive of a vehicle over a site, with every disturbance as a setting.

mod capture;
mod frame;
mod plan;
mod rig;
mod settings;

pub use frame::{Instant, InstantTruth};
pub use plan::PlannedMission;
pub use rig::{CALIBRATION_RANGE, CalibrationError, FocalIn, RigPlan};
pub use settings::{Mission, PriorKind};

#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod inspection_tests;
#[cfg(test)]
mod tests;
