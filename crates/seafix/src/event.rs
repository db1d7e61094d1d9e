//! Events of a navigation session.

use std::fmt;

/// An event of one frame: a change of state, the use of a fix, a displaced object, a key frame.
#[derive(Debug, Clone, PartialEq)]
pub enum NavigationEvent {
    /// The odometry has no motion to this stereo pair.
    NoMotion {
        /// The reason.
        why: String,
    },
    /// A fix that cannot be used, because the effect of the model's errors on it is unknown.
    FixUnused {
        /// The object's name.
        object: String,
        /// The reason.
        why: String,
    },
    /// A fix that became the navigated pose.
    FixTaken {
        /// The object's name.
        object: String,
    },
    /// A fix that is less accurate than the navigated pose, which stays.
    FixLeft {
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
    /// Several fixes that agree with each other replaced the navigated pose.
    FixesOverrule {
        /// The object's name.
        object: String,
    },
    /// Two objects that contradict each other: one of them was moved since the survey.
    Disputed {
        /// The two objects' names.
        objects: [String; 2],
        /// The contradiction (m).
        metres: f64,
    },
    /// An object that was moved since the survey.
    Displaced {
        /// The object's name.
        object: String,
        /// The distance from its surveyed place (m).
        metres: f64,
    },
    /// A key frame that was recognised.
    KeyframeFound {
        /// The index of the key frame.
        keyframe: usize,
        /// The number of points found again.
        found: usize,
        /// The number of points matched.
        matches: usize,
        /// Standard deviation of the position relative to the key frame (m).
        sigma: f64,
        /// Whether the pose graph rejected it.
        given_up: bool,
    },
    /// No key frame was recognised where one may be in view.
    NoKeyframe {
        /// The reason.
        why: String,
    },
    /// A key frame was added to the map.
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
                write!(f, "fix at {object} not used, what it owes to the model is unknown: {why}")
            }
            Self::FixTaken { object } => write!(f, "fix at {object} taken"),
            Self::FixLeft { object } => {
                write!(f, "fix at {object} left: the last one, carried here, is better known")
            }
            Self::FixDoubted { object, why } => write!(f, "fix at {object} doubted: {why}"),
            Self::FixesOverrule { object } => write!(f, "fixes at {object} overrule what was known"),
            Self::Disputed { objects: [one, other], metres } => {
                write!(f, "{one} or {other} stands {metres:.3} m from its place, ")?;
                write!(f, "one of the two; a third object will tell which")
            }
            Self::Displaced { object, metres } => write!(f, "{object} stands {metres:.3} m from its place"),
            Self::KeyframeFound { keyframe, found, matches, sigma, given_up } => {
                write!(f, "key frame {keyframe} found again, {found} of {matches} points, ")?;
                match given_up {
                    true => write!(f, "contradicts the network: given up"),
                    false => write!(f, "to {:.1} mm", 1e3 * sigma),
                }
            }
            Self::NoKeyframe { why } => write!(f, "no key frame found again: {why}"),
            Self::KeyframeAdded { keyframe } => write!(f, "key frame {keyframe} laid"),
            Self::State { from, to, why } => write!(f, "{from} → {to}: {why}"),
        }
    }
}
