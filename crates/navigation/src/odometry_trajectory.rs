//! What an odometry found: segments of poses, and what became of every pair.

use seafix_geometry::{Camera, Covariance6, Transform, World};

use crate::{CorrelatedError, Device};

/// All that an odometry found.
#[derive(Debug, Clone, Default)]
pub struct OdometryTrajectory {
    /// Stretches without a break, in order of time; every pair that was followed is in one.
    pub segments: Vec<Segment>,
    /// What became of each pair, in their order.
    pub outcomes: Vec<OdometryOutcome>,
    /// Milliseconds that each stage took in all, in the order of the work.
    pub times: Vec<(&'static str, f64)>,
}

/// A stretch over which the motion is known.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Why the motion from the segment before to this one is unknown; absent for the first.
    pub broken: Option<Lost>,
    /// Its poses, in order of time.
    pub poses: Vec<Waypoint>,
}

/// Where the left camera was at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Waypoint {
    /// When (ns).
    pub stamp_ns: u64,
    /// Its pose. The world is the left camera of the journey's first waypoint. A segment after a break begins where the
    /// one before ended: the motion between is unknown and left out, not guessed.
    pub world_from_camera: Transform<World, Camera>,
    /// The motion from the waypoint before; absent for the first of a segment.
    pub local: Option<RelativeMotion>,
}

/// The motion between two successive waypoints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeMotion {
    /// `earlier_from_later`, when the later pair was first seen.
    pub motion: Transform<Camera, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Camera, Camera>,
    /// What its error has in common with those of the steps around it; nothing where it is independent of them.
    pub correlated: Option<CorrelatedError>,
}

impl RelativeMotion {
    /// A motion that errs independently of all others.
    pub fn new(motion: Transform<Camera, Camera>, covariance: Covariance6<Camera, Camera>) -> Self {
        Self { motion, covariance, correlated: None }
    }
}

/// What became of a pair.
#[derive(Debug, Clone, PartialEq)]
pub enum OdometryOutcome {
    /// A segment begins with it.
    Began,
    /// Its motion is known.
    Followed {
        /// Landmarks that were sought in it; none by an odometry that has none.
        sought: usize,
        /// Those that were found and agree with its pose.
        found: usize,
    },
    /// It was left out.
    Skipped(Lost),
}

/// One of the two cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The left camera.
    Left,
    /// The right camera.
    Right,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// Why a motion is unknown.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Lost {
    /// An image that shows nothing.
    #[error("the {0} image shows nothing: its brightness varies by {1:.2} grey levels")]
    Blank(Side, f64),
    /// An image at the end of its range.
    #[error("the {0} image is saturated: {1:.0} % of it is white")]
    Saturated(Side, f64),
    /// The same image again.
    #[error("the {0} image is the one before again, bit for bit: the camera stands still or is frozen")]
    Frozen(Side),
    /// Too few points to begin or go on with.
    #[error("{found} points measured; {needed} are needed")]
    FewPoints {
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// Too few points in common.
    #[error("{found} points look like points of the pair before; {needed} are needed")]
    FewMatches {
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// No motion explains enough of what is in common.
    #[error("no motion explains more than {found} of {matches} points in common; {needed} are needed")]
    NoConsensus {
        /// How many the best motion explains.
        found: usize,
        /// Of how many.
        matches: usize,
        /// How many are needed.
        needed: usize,
    },
    /// What stands still in the image may be a part of the vehicle: other points moved, and of it none has ever been seen to.
    #[error("{still} points stand still in the image and {moving} agree on a motion: the vehicle's may be either")]
    Still {
        /// How many stand still.
        still: usize,
        /// How many of the others agree on a motion.
        moving: usize,
    },
    /// The motion that explains the points is not determined well enough.
    #[error("the motion is known to {0:.3} m only")]
    Weak(f64),
    /// A sensor that it goes by is not heard.
    #[error("the {device} says nothing that can be used for {seconds:.3} s; at most {max} s are bridged")]
    Silent {
        /// Which.
        device: Device,
        /// How long (s).
        seconds: f64,
        /// What is bridged (s).
        max: f64,
    },
    /// Too long a time between two pairs.
    #[error("{seconds:.3} s without a pair that could be followed; at most {max} s are bridged{}", units(.seconds))]
    Gap {
        /// How long (s).
        seconds: f64,
        /// What is bridged (s).
        max: f64,
    },
    /// A motion faster than the vehicle can be.
    #[error("a motion of {speed:.2} m/s{}", unlikely(.seconds, .max))]
    Jump {
        /// How fast (m/s).
        speed: f64,
        /// In what time (s).
        seconds: f64,
        /// The fastest that is believed (m/s).
        max: f64,
    },
}

/// What a gap of more than a year suggests.
fn units(seconds: &f64) -> &'static str {
    const YEAR: f64 = 365.25 * 86_400.0;
    if *seconds > YEAR { "; that is more than a year: are seconds and nanoseconds mixed?" } else { "" }
}

/// What a motion too fast suggests: cameras take no two pairs within a millisecond, else it is the vehicle that cannot.
fn unlikely(seconds: &f64, max: &f64) -> String {
    const AT_ONCE: f64 = 1e-3;
    if *seconds <= AT_ONCE {
        return format!(", as {:.6} ms passed: are the stamps right?", 1e3 * seconds);
    }
    format!("; the vehicle moves at most at {max} m/s")
}

impl OdometryTrajectory {
    /// The length of the way over all segments (m).
    pub fn length(&self) -> f64 {
        let steps = self.segments.iter().flat_map(|segment| segment.poses.windows(2));
        steps
            .map(|two| (two[1].world_from_camera.translation() - two[0].world_from_camera.translation()).norm())
            // The empty sum is −0.
            .fold(0.0, |path, step| path + step)
    }

    /// The median share of the landmarks sought in a pair that were found and agree with its pose; `None` when no pair
    /// was followed by landmarks. Where much of what is in view moves otherwise than the rest it is small.
    pub fn agreement(&self) -> Option<f64> {
        let fraction = |outcome: &OdometryOutcome| match outcome {
            OdometryOutcome::Followed { sought, found } if *sought > 0 => Some(*found as f64 / *sought as f64),
            OdometryOutcome::Followed { .. } | OdometryOutcome::Began | OdometryOutcome::Skipped(_) => None,
        };
        let mut sensitivities: Vec<f64> = self.outcomes.iter().filter_map(fraction).collect();
        sensitivities.sort_unstable_by(f64::total_cmp);
        sensitivities.get(sensitivities.len() / 2).copied()
    }

    /// All waypoints, in order of time.
    pub fn waypoints(&self) -> impl Iterator<Item = &Waypoint> {
        self.segments.iter().flat_map(|segment| &segment.poses)
    }
}
