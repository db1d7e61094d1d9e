//! Measured points of a cloud.

use nalgebra::Matrix4;

use crate::{covariance::UncertainPoint, frame::Camera, stereo::StereoPixels};

/// The two pixels of a point, with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPixels {
    /// The two pixels.
    pub at: StereoPixels,
    /// Covariance of (u left, v left, u right, v right) (px²).
    ///
    /// A point located in one image and aligned to the other has correlated errors: Σ = [[L, L], [L, L + A]] with L the
    /// covariance of the location and A that of the alignment.
    pub covariance: Matrix4<f64>,
}

impl UncertainPixels {
    /// Two pixels with independent errors of standard deviation `sigma` (px) in all four coordinates.
    pub fn independent(at: StereoPixels, sigma: f64) -> Self {
        Self { at, covariance: Matrix4::identity() * (sigma * sigma) }
    }
}

/// A point measured by the stereo rig, not yet identified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// The position with its covariance.
    pub position: UncertainPoint<Camera>,
    /// The pixels in both images; `None` for a cloud of bare points.
    pub pixels: Option<UncertainPixels>,
}
