//! Events of a navigation session.

use std::fmt;

/// An event of one frame, printed as one sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum NavigationEvent {
    /// A frame that the odometry skipped.
    NoMotion {
        /// The reason.
        why: String,
    },
    /// A fix that is not used, because its sensitivity to model errors is undetermined.
    FixUnused {
        /// The object's name.
        object: String,
        /// The reason.
        why: String,
    },
    /// An accepted fix, combined with the navigated pose.
    FixTaken {
        /// The object's name.
        object: String,
    },
    /// A fix of another object at which the pose would be much less accurate; the navigated pose stays.
    FixLessAccurate {
        /// The object's name.
        object: String,
    },
    /// A fix that contradicts the navigated pose.
    FixDoubted {
        /// The object's name.
        object: String,
        /// The contradiction, with its numbers.
        why: String,
    },
    /// Several consistent fixes that replaced the navigated pose.
    FixesOverrule {
        /// The object's name.
        object: String,
    },
    /// Two objects whose distance contradicts the survey: one of them was moved.
    Disputed {
        /// The two objects' names.
        objects: [String; 2],
        /// The displacement of one if the other has not moved (m).
        metres: f64,
    },
    /// An object that was moved since the survey.
    Displaced {
        /// The object's name.
        object: String,
        /// The displacement (m).
        metres: f64,
    },
    /// A key frame that was recognised.
    KeyframeFound {
        /// The index of the key frame.
        keyframe: usize,
        /// The number of matches that agree with the motion.
        inliers: usize,
        /// The number of matches.
        matches: usize,
        /// The standard deviation of the position relative to the key frame along one axis (m).
        sigma: f64,
        /// Whether the pose graph rejected it.
        loop_rejected: bool,
    },
    /// A frame in which no key frame was recognised although one may be in view.
    NoKeyframe {
        /// The reason.
        why: String,
    },
    /// A key frame that was added to the map.
    KeyframeAdded {
        /// The index of the key frame.
        keyframe: usize,
    },
    /// A change of the navigator's state.
    State {
        /// The state before.
        from: String,
        /// The state after.
        to: String,
        /// The reason.
        why: String,
    },
}

impl fmt::Display for NavigationEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMotion { why } => write!(f, "no motion to this pair: {why}"),
            Self::FixUnused { object, why } => {
                write!(f, "fix at {object} not used, its sensitivity to model errors is undetermined: {why}")
            }
            Self::FixTaken { object } => write!(f, "fix at {object} accepted"),
            Self::FixLessAccurate { object } => {
                write!(f, "fix at {object} not used: the previous fix, moved here by odometry, is more accurate")
            }
            Self::FixDoubted { object, why } => write!(f, "fix at {object} held back: {why}"),
            Self::FixesOverrule { object } => write!(f, "fixes at {object} replace the navigated pose"),
            Self::Disputed { objects: [one, other], metres } => {
                write!(f, "{one} or {other} is {metres:.3} m from its place in the survey, ")?;
                write!(f, "a third object decides which")
            }
            Self::Displaced { object, metres } => write!(f, "{object} is {metres:.3} m from its place in the survey"),
            Self::KeyframeFound { keyframe, inliers, matches, sigma, loop_rejected } => {
                write!(f, "key frame {keyframe} recognised with {inliers} of {matches} matches, ")?;
                match loop_rejected {
                    true => write!(f, "rejected: inconsistent with the pose graph"),
                    false => write!(f, "position ± {:.1} mm on each axis", 1e3 * sigma),
                }
            }
            Self::NoKeyframe { why } => write!(f, "no key frame recognised: {why}"),
            Self::KeyframeAdded { keyframe } => write!(f, "key frame {keyframe} added"),
            Self::State { from, to, why } => write!(f, "{from} → {to}: {why}"),
        }
    }
}
