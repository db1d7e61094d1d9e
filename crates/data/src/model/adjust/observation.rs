//! The measurements of an adjustment.

use seafix_geometry::UncertainPixels;
use seafix_navigation::RelativeMotion;

/// A point observed in both images of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Observation {
    /// The index of the pair's pose.
    pub view: usize,
    /// The index of the point.
    pub point: usize,
    /// The pixels, with the covariance of their own errors.
    pub pixels: UncertainPixels,
}

/// The motion between two pairs by an odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// The index of the earlier pose.
    pub from: usize,
    /// The index of the later pose.
    pub to: usize,
    /// The motion `earlier_from_later` with its covariance.
    pub motion: RelativeMotion,
}
