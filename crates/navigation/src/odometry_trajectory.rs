//! The result of an odometry: segments of poses, and the outcome of every pair.

use seafix_geometry::{Camera, Covariance6, Transform, World};

use crate::{correlated_error::CorrelatedError, reading::Device};

/// The result of an odometry.
#[derive(Debug, Clone, Default)]
pub struct OdometryTrajectory {
    /// Segments without a break, in order of time; every followed pair is part of one.
    pub segments: Vec<Segment>,
    /// The outcome of each pair, in order.
    pub outcomes: Vec<OdometryOutcome>,
    /// Total time of each stage (ms), in order of execution.
    pub times: Vec<(&'static str, f64)>,
}

/// A part of the trajectory over which the motion is known.
#[derive(Debug, Clone)]
pub struct Segment {
    /// The reason of the break before this segment; `None` for the first.
    pub broken: Option<Lost>,
    /// The poses, in order of time.
    pub poses: Vec<Waypoint>,
}

/// The pose of the left camera at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Waypoint {
    /// Time (ns).
    pub stamp_ns: u64,
    /// The pose; the world is the left camera's frame at the first waypoint of the trajectory.
    ///
    /// A segment after a break begins where the previous one ended: the motion between them is unknown and omitted, not
    /// extrapolated.
    pub world_from_camera: Transform<World, Camera>,
    /// The motion from the previous waypoint; `None` for the first of a segment.
    pub local: Option<RelativeMotion>,
}

/// The motion between two successive waypoints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeMotion {
    /// The motion `earlier_from_later`, as estimated when the later pair arrived.
    pub motion: Transform<Camera, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Camera, Camera>,
    /// The part of its error that is correlated with other steps; `None` if the error is independent.
    pub correlated: Option<CorrelatedError>,
}

impl RelativeMotion {
    /// A motion whose error is independent of all other errors.
    pub fn new(motion: Transform<Camera, Camera>, covariance: Covariance6<Camera, Camera>) -> Self {
        Self { motion, covariance, correlated: None }
    }
}

/// The outcome of one pair.
#[derive(Debug, Clone, PartialEq)]
pub enum OdometryOutcome {
    /// The pair begins a segment.
    Began,
    /// The motion of the pair is known.
    Followed {
        /// Number of landmarks searched for in the pair; 0 for an odometry without landmarks.
        sought: usize,
        /// Number of landmarks that were found and agree with the pose.
        found: usize,
    },
    /// The pair was skipped.
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

/// The reason of an unknown motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Lost {
    /// A blank image.
    #[error("the {0} image is blank: its brightness varies by {1:.2} grey levels")]
    Blank(Side, f64),
    /// A saturated image.
    #[error("the {0} image is saturated: {1:.0} % of its pixels are white")]
    Saturated(Side, f64),
    /// A repeated image.
    #[error("the {0} image repeats the previous one bit for bit: the camera stands still or is frozen")]
    Frozen(Side),
    /// Too few measured points.
    #[error("{found} points measured; at least {needed} are needed")]
    FewPoints {
        /// Number of points.
        found: usize,
        /// Minimum number of points.
        needed: usize,
    },
    /// Too few matches with the previous pair.
    #[error("{found} points match the previous pair; at least {needed} are needed")]
    FewMatches {
        /// Number of matches.
        found: usize,
        /// Minimum number of matches.
        needed: usize,
    },
    /// No motion that explains enough matches.
    #[error("no motion explains more than {found} of {matches} matches; at least {needed} are needed")]
    NoConsensus {
        /// Number of matches that the best motion explains.
        found: usize,
        /// Number of matches.
        matches: usize,
        /// Minimum number of explained matches.
        needed: usize,
    },
    /// Static points that may belong to the vehicle: other points moved, and no static point has ever moved in the
    /// image.
    #[error(
        "{still} points are static in the image and {moving} agree on a motion: the static ones may be part of the vehicle"
    )]
    Still {
        /// Number of static points.
        still: usize,
        /// Number of other points that agree on a motion.
        moving: usize,
    },
    /// A motion with a position uncertainty above the limit (m).
    #[error("the motion is too uncertain: its position has a standard deviation of {0:.3} m")]
    Weak(f64),
    /// A required sensor without usable readings.
    #[error("the {device} gave no usable reading for {seconds:.3} s; at most {max} s are bridged")]
    Silent {
        /// The sensor.
        device: Device,
        /// Time without a reading (s).
        seconds: f64,
        /// Maximum time that is bridged (s).
        max: f64,
    },
    /// Too long a time between two usable pairs.
    #[error("{seconds:.3} s without a usable pair; at most {max} s are bridged{}", units(.seconds))]
    Gap {
        /// Time between the pairs (s).
        seconds: f64,
        /// Maximum time that is bridged (s).
        max: f64,
    },
    /// A motion faster than the maximum speed.
    #[error("a motion of {speed:.2} m/s{}", unlikely(.seconds, .max))]
    Jump {
        /// Speed (m/s).
        speed: f64,
        /// Time between the pairs (s).
        seconds: f64,
        /// Maximum speed (m/s).
        max: f64,
    },
}

/// A hint for a gap of more than a year.
fn units(seconds: &f64) -> &'static str {
    const YEAR: f64 = 365.25 * 86_400.0;
    if *seconds > YEAR { "; that is more than a year: are seconds and nanoseconds mixed?" } else { "" }
}

/// A hint for a motion that is too fast: a pair within a millisecond indicates wrong stamps.
fn unlikely(seconds: &f64, max: &f64) -> String {
    const AT_ONCE: f64 = 1e-3;
    if *seconds <= AT_ONCE {
        return format!(", because {:.6} ms passed: are the stamps right?", 1e3 * seconds);
    }
    format!("; the maximum speed is {max} m/s")
}

impl OdometryTrajectory {
    /// The path length over all segments (m).
    pub fn length(&self) -> f64 {
        let steps = self.segments.iter().flat_map(|segment| segment.poses.windows(2));
        steps
            .map(|two| (two[1].world_from_camera.translation() - two[0].world_from_camera.translation()).norm())
            // The empty sum is −0.
            .fold(0.0, |path, step| path + step)
    }

    /// The median fraction of the landmarks in a pair that were found and agree with its pose.
    ///
    /// It is small if much of the view moves differently from the rest. `None` if no pair was followed by landmarks.
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
