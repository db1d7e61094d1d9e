//! A point of the cloud: what the eyes hand to the method.

use nalgebra::Matrix4;

use crate::{Camera, StereoPixels, UncertainPoint};

/// Where the two images show one point, and how well that is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPixels {
    /// The two pixels.
    pub at: StereoPixels,
    /// Covariance of (u left, v left, u right, v right) (px²). A place that was found in one image and
    /// aligned to the other errs in both alike: Σ = [[L, L], [L, L + A]] with L the error of the place
    /// and A that of the alignment.
    pub covariance: Matrix4<f64>,
}

impl UncertainPixels {
    /// Two pixels whose four coordinates err independently by `sigma` (px).
    pub fn independent(at: StereoPixels, sigma: f64) -> Self {
        Self { at, covariance: Matrix4::identity() * (sigma * sigma) }
    }
}

/// One point that the stereo rig measured, not yet believed to be anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Where it is, and how well that is known.
    pub position: UncertainPoint<Camera>,
    /// Where the two images show it; absent when the cloud came as bare points.
    pub pixels: Option<UncertainPixels>,
}
