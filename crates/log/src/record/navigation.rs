//! What a navigator knew after a pair, and what it did.

use super::{
    matrix::{Matrix4, Matrix6},
    mirror::mirror,
};

/// How an event ends that says how far an object stands from where it was surveyed, after the distance.
pub const ELSEWHERE: &str = "m from its place";

/// What a trial that navigates between fixes knew after a pair.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NavigationRecord {
    /// What the pose rests on: `prior_pose`, `searching`, `fixed` or `dead session`.
    pub state: String,
    /// Whether a fix was tried.
    pub due: bool,
    /// The camera relative to the object it was last fixed at; `None` while no fix holds.
    pub pose: Option<NavigatedRecord>,
    /// The first fix carried here by odometry alone; `None` before it and after the way was lost.
    pub odometry_only: Option<NavigatedRecord>,
    /// What the odometry made of the pair.
    pub odometry: OdometryStep,
    /// What happened, in words: changes of state, fixes taken or doubted, displaced objects.
    pub events: Vec<String>,
    /// Comparison with truth.
    pub errors: NavigationErrors,
}

/// The left camera relative to an object.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigatedRecord {
    /// Id of the object.
    pub object: String,
    /// The pose.
    pub object_from_camera: Matrix4,
    /// Its covariance.
    pub covariance: Matrix6,
}

/// What the odometry made of a pair.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OdometryStep {
    /// Why no motion to the pair is known; empty where one is, and at the beginning. It ends in `the way here is unknown` where the
    /// way is broken and goes on from this pair; else the pair was left out, and the next motion leads over it.
    pub lost: String,
    /// The motion from the pair known before, `earlier_from_later`, and its covariance.
    pub motion: Option<(Matrix4, Matrix6)>,
}

mirror! {
    /// How the navigated poses compare with truth; `None` where truth or a pose is missing.
    #[derive(Debug, Clone, Copy, PartialEq, Default)]
    pub struct NavigationErrors {
        /// The TRE of the navigated pose over the points of its object (m).
        pub tre_rms: Option<f64>,
        /// The position error (m).
        pub position_error: Option<f64>,
        /// The attitude error (rad).
        pub attitude_error: Option<f64>,
        /// Normalised estimation error squared, six degrees of freedom.
        pub nees: Option<f64>,
        /// The position error (m) of the first fix carried by odometry alone.
        pub odometry_only_position_error: Option<f64>,
        /// Likewise, attitude (rad).
        pub odometry_only_attitude_error: Option<f64>,
    }
}
