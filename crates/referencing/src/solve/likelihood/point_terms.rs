//! The terms of measured 3D points, with prepared weights.

use nalgebra::{Matrix3, Vector3};
use smallvec::SmallVec;

use crate::{observations::Observation, solve::likelihood::descent::Term};

/// Number of points that are kept without heap allocation.
pub(crate) const FEW: usize = 32;

/// The points with the inverse of their measured covariance.
pub(crate) struct Measured<'a> {
    points: &'a [Observation],
    information: SmallVec<[Matrix3<f64>; FEW]>,
}

impl<'a> Measured<'a> {
    pub(crate) fn of(points: &'a [Observation]) -> Self {
        Self { points, information: points.iter().map(information).collect() }
    }

    /// The term of the k-th point at the position where a pose puts it.
    #[inline]
    pub(crate) fn term(&self, k: usize, at: &Vector3<f64>) -> Term {
        Term::of(self.information[k], &(self.points[k].measured.at.coords - at))
    }
}

/// (Σ_measured + σ_model² I)⁻¹.
pub(crate) fn information(point: &Observation) -> Matrix3<f64> {
    let noise = point.noise();
    // Scaled to unit size, so that the determinant neither overflows nor underflows.
    let size = noise.trace() / 3.0;
    (noise / size).try_inverse().unwrap_or_else(Matrix3::identity) / size
}

#[cfg(test)]
mod tests {
    use seafix_geometry::{Point, UncertainPoint};

    use super::*;

    /// Noise of 1, 2 and 3 mm along the axes and 2 mm of the model: variances of 5, 8 and 13 mm².
    #[test]
    fn the_information_is_the_inverse_of_both_noises() {
        let measured = UncertainPoint {
            at: Point::new(0.1, 0.2, 3.0),
            covariance: Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-6, 9e-6)),
        };
        let point = Observation { measured, pixels: None, model: Point::origin(), model_sigma: 2e-3 };
        let expected = Matrix3::from_diagonal(&Vector3::new(1.0 / 5e-6, 1.0 / 8e-6, 1.0 / 13e-6));
        assert!((information(&point) - expected).amax() < 1e-6 * expected.amax());
        // Determinants out of the range of numbers.
        for sigma in [1e-60, 1e60] {
            let point =
                Observation { measured: UncertainPoint::isotropic(Point::origin(), sigma), model_sigma: 0.0, ..point };
            let variance: f64 = 1.0 / (sigma * sigma + 1e-18);
            assert!((information(&point)[(1, 1)] / variance - 1.0).abs() < 1e-9, "{sigma}");
        }
    }
}
