//! Protection levels, and the distances and deviations that they are made of.

use nalgebra::Matrix3;
use seafix_geometry::{Camera, Covariance6, Object, Transform, so3};

use crate::chi_square::chi_square;

/// Protection levels: radii that the errors of a fix exceed with at most the stated risk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Protection {
    /// The level of the camera's position in the object frame (m).
    pub position: f64,
    /// The level of the attitude (rad).
    pub attitude: f64,
}

impl Protection {
    /// The fault-free radii: errors with this covariance exceed each with the given probability.
    pub(in crate::accept) fn quiet(covariance: &Covariance6<Object, Camera>, probability: f64) -> Self {
        let (position, attitude) = semi_axes(covariance);
        let quiet = radius(probability);
        Self { position: quiet * position, attitude: quiet * attitude }
    }

    /// Raises the levels to cover another pose with the same precision as `quiet`.
    pub(in crate::accept) fn cover(
        &mut self,
        quiet: &Self,
        fix: &Transform<Object, Camera>,
        other: &Transform<Object, Camera>,
    ) {
        let (moved, turned) = apart(fix, other);
        *self = self.max(&Self { position: moved + quiet.position, attitude: turned + quiet.attitude });
    }

    /// The larger radii of two.
    pub(in crate::accept) fn max(&self, other: &Self) -> Self {
        Self { position: self.position.max(other.position), attitude: self.attitude.max(other.attitude) }
    }
}

/// The distance between two camera poses: position (m) and attitude (rad).
pub(in crate::accept) fn apart(one: &Transform<Object, Camera>, other: &Transform<Object, Camera>) -> (f64, f64) {
    let moved = (one.translation() - other.translation()).norm();
    (moved, so3::angle(&(one.rotation().inverse() * other.rotation())))
}

/// The largest semi-axis of a covariance, if it may exceed `limit`; the root of the matrix's norm bounds it.
pub(in crate::accept) fn longer_than(limit: f64, covariance: &Matrix3<f64>) -> Option<f64> {
    /// Upper bound of the rounding of the norm.
    const ROUNDED: f64 = 1.0 + 1e-12;
    // A NaN is included.
    (!(covariance.norm().sqrt() * ROUNDED <= limit)).then(|| semi_axis(covariance))
}

/// The largest semi-axis of a covariance.
pub(in crate::accept) fn semi_axis(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// The block of the attitude (`first` = 0) or of the position (3).
pub(in crate::accept) fn block(covariance: &Covariance6<Object, Camera>, first: usize) -> Matrix3<f64> {
    covariance.matrix.fixed_view::<3, 3>(first, first).into()
}

/// The largest standard deviations of position (m) and attitude (rad) over all directions.
pub(in crate::accept) fn semi_axes(covariance: &Covariance6<Object, Camera>) -> (f64, f64) {
    (semi_axis(&block(covariance, 3)), semi_axis(&block(covariance, 0)))
}

/// The radius, in standard deviations, that a three-dimensional normal vector exceeds with this probability.
pub(in crate::accept) fn radius(probability: f64) -> f64 {
    chi_square(3, 1.0 - probability).sqrt()
}
