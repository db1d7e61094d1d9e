//! Errors of the calibration, considered and not estimated (Schmidt).
//!
//! All pairs share them, so more pairs do not reduce them. The points move by K = N⁻¹ Jᵀ W D with the derivatives D of
//! the pixels by the parameters, and K Q Kᵀ is added to the covariance.

use nalgebra::Vector4;
use seafix_geometry::{Camera, Point, StereoRig, Transform};

/// Standard deviations of a rig's calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationSigma {
    /// Of the four coordinates of the principal points (px).
    pub pixels: f64,
    /// Of the baseline, relative to its length: it is the scale of the model.
    pub baseline: f64,
}

impl Default for CalibrationSigma {
    /// A good calibration in water: principal points to 0.05 px and the baseline to 0.1 %.
    fn default() -> Self {
        Self { pixels: 0.05, baseline: 1e-3 }
    }
}

/// A calibration parameter with its standard deviation.
#[derive(Debug, Clone)]
pub(super) enum Parameter {
    /// A coordinate of a principal point, in the order of pixels (px).
    Offset(usize, f64),
    /// The rig with a longer baseline.
    Baseline(Box<StereoRig>),
}

impl CalibrationSigma {
    /// The parameters with an error.
    pub(super) fn parameters(&self, rig: &StereoRig) -> Vec<Parameter> {
        let offsets = (0..4).filter(|_| self.pixels > 0.0).map(|k| Parameter::Offset(k, self.pixels));
        let across = rig.right_from_left();
        let longer = Transform::new(across.rotation(), across.translation() * (1.0 + self.baseline));
        let longer = StereoRig::new(*rig.left(), *rig.right(), longer).ok();
        offsets.chain(longer.filter(|_| self.baseline > 0.0).map(|rig| Parameter::Baseline(Box::new(rig)))).collect()
    }
}

impl Parameter {
    /// The change of a point's pixels (px) by one standard deviation of the parameter; `None` for a point that a camera
    /// cannot see.
    pub(super) fn shift(&self, rig: &StereoRig, at: &Point<Camera>) -> Option<Vector4<f64>> {
        Some(match self {
            Self::Offset(k, sigma) => Vector4::ith(*k, *sigma),
            Self::Baseline(longer) => longer.project(at)?.coordinates() - rig.project(at)?.coordinates(),
        })
    }
}
