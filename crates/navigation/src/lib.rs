//! The motion of the vehicle from image to image.
//!
//! [`Odometry`] follows a stereo rig from pair to pair, by its images or by what other sensors say ([`Reading`]); what it finds is a [`OdometryTrajectory`]: segments of poses relative to
//! the first camera, and what became of every pair. Where it cannot say how the rig moved it says so ([`Lost`]) instead
//! of inventing a motion. A [`ObjectPose`] carries a fix along its steps; a [`Navigator`] goes
//! from fix to fix and from object to object. This crate knows no truth.

mod chain;
mod consider_states;
mod correlated_error;
mod dvl_gyro;
mod fusion;
mod icp;
mod navigated;
mod navigator;
mod odometry;
mod odometry_trajectory;
mod policy;
mod pose_graph;
mod reading;
mod stereo;
mod times;
mod unusable;

pub use chain::{ObjectPose, by_world};
pub use consider_states::{ConsiderStates, Sensitivity};
pub use correlated_error::CorrelatedError;
pub use dvl_gyro::DvlGyro;
pub use fusion::{Contradiction, FUSIONS, Fuse, Fusion, Intersect, Replace};
pub use icp::{Distance, Icp};
pub use navigated::{Navigated, ObjectPlacement};
pub use navigator::{Displacement, Event, Navigator, State, StateChange};
pub use odometry::{NotAfter, ODOMETRIES, Odometry, OdometrySession, StereoPair};
pub use odometry_trajectory::{Lost, OdometryOutcome, OdometryTrajectory, RelativeMotion, Segment, Side, Waypoint};
pub use policy::{EveryFrame, InView, Interval, POLICIES, Policy, ProtectionLevel, Situation, Travelled};
pub use pose_graph::{
    Closed, Closure, FactorGraph, FixEdge, Footprint, GraphSolution, KeyFrame, LoopCandidate, NoCovariance,
    NotRecognized, OdometryEdge, PlaceRecognizer, PoseEstimate, PoseGraph, PoseGraphSettings, PoseNode, PriorPose,
    Recognition, Recognized, Relocalization, StereoFeatures, Traverse,
};
pub use reading::{Device, Reading};
pub use stereo::Stereo;
