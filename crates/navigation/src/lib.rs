//! The motion of the vehicle from image to image.
//!
//! [`Odometry`] follows a stereo rig from pair to pair, by its images or by what other sensors say ([`Reading`]); what it finds is a [`Journey`]: segments of poses relative to
//! the first camera, and what became of every pair. Where it cannot say how the rig moved it says so ([`Lost`]) instead
//! of inventing a motion. A [`Standing`] carries a fix along its steps; a [`Navigator`] goes
//! from fix to fix and from object to object. This crate knows no truth.

mod chain;
mod considered;
mod dvl_gyro;
mod fusion;
mod icp;
mod journey;
mod lasting;
mod navigated;
mod navigator;
mod network;
mod odometry;
mod policy;
mod reading;
mod stereo;
mod times;
mod unusable;

pub use chain::{Standing, by_world};
pub use considered::{Considered, Share};
pub use dvl_gyro::DvlGyro;
pub use fusion::{Contradiction, FUSIONS, Fuse, Fusion, Intersect, Replace};
pub use icp::{Distance, Icp};
pub use journey::{Journey, Local, Lost, Outcome, Segment, Side, Waypoint};
pub use lasting::Lasting;
pub use navigated::{Navigated, Place};
pub use navigator::{Change, Displacement, Event, Navigator, State};
pub use network::{
    Candidate, Closed, Closure, Fix, Footprint, Glance, Graph, Here, KeyFrame, Leg, Network, NetworkSettings,
    NoCovariance, Recognised, Recogniser, Recognition, Refound, Rough, Solved, Station, Traverse, Unrecognised,
};
pub use odometry::{NotAfter, ODOMETRIES, Odometry, Reckoning, StereoPair};
pub use policy::{EveryFrame, InView, Interval, POLICIES, Policy, ProtectionLevel, Situation, Travelled};
pub use reading::{Device, Reading};
pub use stereo::Stereo;
