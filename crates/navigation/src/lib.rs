//! Odometry, fusion with fixes, re-referencing policies and the pose graph.
//!
//! - An [`Odometry`] estimates the motion of a stereo rig from image pairs or from sensor readings ([`Reading`]). Its
//!   result is an [`OdometryTrajectory`]: segments of poses relative to the first camera, and the outcome of every
//!   pair. A pair without a reliable motion is [`Lost`]; no motion is invented.
//! - An [`ObjectPose`] is the pose of a fix with its covariance, at the fix or propagated by odometry.
//! - A [`Navigator`] asks its [`Policy`] whether a fix is due, joins a new fix with the propagated pose by its
//!   [`Fusion`], and detects displaced objects.
//! - A [`PoseGraph`] holds key frames, odometry, fixes and loops; [`Traverse`] extends it during a dive.
//!
//! No function of this crate has access to ground truth.
//!
//! ```
//! use seafix_component::Choice;
//! use seafix_geometry::{Camera, Covariance6, Object, Transform};
//! use seafix_navigation::{FUSIONS, ObjectPose, POLICIES, RelativeMotion, Situation};
//!
//! let pose = |x: f64| Transform::<Object, Camera>::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into());
//! let fix = |x: f64| ObjectPose::new(pose(x), Covariance6::isotropic(0.01, 0.01));
//!
//! // Dead reckoning: one metre along x, with a standard deviation of 0.1 m for each axis.
//! let step = Transform::<Camera, Camera>::exp(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0].into());
//! let known = fix(0.0).after(&RelativeMotion::new(step, Covariance6::isotropic(0.01, 0.1)));
//!
//! // A fix is due 30 s after the last one.
//! let policy = POLICIES.build(&Choice::named("interval").with("seconds", 30.0)).unwrap();
//! assert!(policy.due(&Situation { seconds: 40.0, metres: 1.0, sigma: 0.1, in_view: true }));
//!
//! // The fused pose is more accurate than either input.
//! let fused = FUSIONS.build(&Choice::named("fuse")).unwrap().take(&known, &fix(1.02)).unwrap();
//! assert!(fused.covariance.position_rms() < known.covariance.position_rms());
//! ```

mod chain;
mod consider_states;
mod correlated_error;
mod dvl_gyro;
mod fusion;
mod icp;
mod navigated;
mod navigator;
mod odometries;
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
pub use odometries::ODOMETRIES;
pub use odometry::{NotAfter, Odometry, OdometrySession, RangeOffset, StereoPair};
pub use odometry_trajectory::{Lost, OdometryOutcome, OdometryTrajectory, RelativeMotion, Segment, Side, Waypoint};
pub use policy::{EveryFrame, InView, Interval, POLICIES, Policy, ProtectionLevel, Situation, Travelled};
pub use pose_graph::{
    Closed, Closure, FactorGraph, FixEdge, Footprint, GraphSolution, KeyFrame, LoopCandidate, NoCovariance,
    NotRecognized, OdometryEdge, PlaceRecognizer, PoseEstimate, PoseGraph, PoseGraphSettings, PoseNode, PriorPose,
    Recognition, Recognized, Relocalization, StereoFeatures, Traverse,
};
pub use reading::{Device, Reading};
pub use stereo::Stereo;
