//! What a navigator knew after a pair, and what it did.

use super::{
    matrix::{Matrix4, Matrix6},
    mirror::mirror,
};

/// The state of the navigation after a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NavigationRecord {
    /// The state: the word of a `State` of the navigator.
    pub state: String,
    /// Whether a fix was due.
    pub due: bool,
    /// The navigated pose, relative to the object of the last fix; `None` without one.
    pub pose: Option<NavigatedRecord>,
    /// The first fix, propagated by odometry alone; `None` before it, and after a break of the odometry.
    pub odometry_only: Option<NavigatedRecord>,
    /// The step of the odometry to this pair.
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

/// The step of the odometry to a pair.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OdometryStep {
    /// The reason why there is no motion; empty if there is one, and at the first pair. Its end tells a skipped pair from a
    /// break, see [`is_break`](Self::is_break).
    pub lost: String,
    /// The motion from the last pair that was followed, `earlier_from_later`, and its covariance.
    pub motion: Option<(Matrix4, Matrix6)>,
}

impl OdometryStep {
    /// The end of the reason where a new segment begins.
    const UNKNOWN: &str = ": the motion to this frame is unknown";

    /// A known motion.
    pub fn known(earlier_from_later: Matrix4, covariance: Matrix6) -> Self {
        Self { lost: String::new(), motion: Some((earlier_from_later, covariance)) }
    }

    /// A skipped pair. The next motion spans it.
    pub fn skipped(why: &str) -> Self {
        Self { lost: why.to_owned(), motion: None }
    }

    /// An unknown motion: a new segment begins at this pair.
    pub fn unknown(why: &str) -> Self {
        Self { lost: format!("{why}{}", Self::UNKNOWN), motion: None }
    }

    /// Whether a new segment begins at this pair.
    pub fn is_break(&self) -> bool {
        self.lost.ends_with(Self::UNKNOWN)
    }
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
