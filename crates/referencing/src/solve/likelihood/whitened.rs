//! Whitened residuals of four pixel coordinates.

use nalgebra::{Matrix3, Matrix4, Matrix4x3, Vector3, Vector4};

use crate::solve::likelihood::descent::Term;

/// The inverse of the Cholesky factor of a pixel covariance, S = L Lᵀ.
///
/// L⁻¹ r has the unit covariance, so that rᵀ S⁻¹ r = ‖L⁻¹ r‖².
#[derive(Debug, Clone, Copy)]
pub(crate) struct Whitener {
    /// The diagonal of L⁻¹.
    scale: [f64; 4],
    /// The part of L⁻¹ below the diagonal, row by row; `None` for independent pixel errors, the usual case.
    below: Option<[f64; 6]>,
}

impl Whitener {
    /// `None` if the covariance is not positive definite.
    pub(crate) fn of(noise: &Matrix4<f64>) -> Option<Self> {
        let s = |i: usize, j: usize| noise[(i, j)];
        let root = |pivot: f64| (pivot > 0.0 && pivot.is_finite()).then(|| 1.0 / pivot.sqrt());
        let independent = (0..4).all(|i| (0..i).all(|j| s(i, j) == 0.0));
        if independent {
            return Some(Self { scale: [root(s(0, 0))?, root(s(1, 1))?, root(s(2, 2))?, root(s(3, 3))?], below: None });
        }
        // L by rows; a, b, c, d are the reciprocals of its diagonal.
        let a = root(s(0, 0))?;
        let l10 = s(1, 0) * a;
        let b = root(s(1, 1) - l10 * l10)?;
        let l20 = s(2, 0) * a;
        let l21 = (s(2, 1) - l20 * l10) * b;
        let c = root(s(2, 2) - l20 * l20 - l21 * l21)?;
        let l30 = s(3, 0) * a;
        let l31 = (s(3, 1) - l30 * l10) * b;
        let l32 = (s(3, 2) - l30 * l20 - l31 * l21) * c;
        let d = root(s(3, 3) - l30 * l30 - l31 * l31 - l32 * l32)?;
        // L⁻¹ by forward substitution.
        let m10 = -l10 * a * b;
        let m20 = -(l20 * a + l21 * m10) * c;
        let m21 = -l21 * b * c;
        let m30 = -(l30 * a + l31 * m10 + l32 * m20) * d;
        let m31 = -(l31 * b + l32 * m21) * d;
        let m32 = -l32 * c * d;
        Some(Self { scale: [a, b, c, d], below: Some([m10, m20, m21, m30, m31, m32]) })
    }

    /// Jᵀ S⁻¹ J, Jᵀ S⁻¹ r and rᵀ S⁻¹ r.
    #[inline]
    pub(crate) fn term(&self, j: &Matrix4x3<f64>, r: &Vector4<f64>) -> Term {
        let [a, b, c, d] = self.scale;
        let row = |i: usize| Vector3::new(j[(i, 0)], j[(i, 1)], j[(i, 2)]);
        let (j0, j1, j2, j3) = (row(0), row(1), row(2), row(3));
        let (rows, r) = match &self.below {
            None => ([j0 * a, j1 * b, j2 * c, j3 * d], [r[0] * a, r[1] * b, r[2] * c, r[3] * d]),
            Some([m10, m20, m21, m30, m31, m32]) => (
                [
                    j0 * a,
                    j0 * *m10 + j1 * b,
                    j0 * *m20 + j1 * *m21 + j2 * c,
                    j0 * *m30 + j1 * *m31 + j2 * *m32 + j3 * d,
                ],
                [
                    r[0] * a,
                    r[0] * m10 + r[1] * b,
                    r[0] * m20 + r[1] * m21 + r[2] * c,
                    r[0] * m30 + r[1] * m31 + r[2] * m32 + r[3] * d,
                ],
            ),
        };
        let sum = |i: usize, k: usize| {
            rows[0][i] * rows[0][k] + rows[1][i] * rows[1][k] + rows[2][i] * rows[2][k] + rows[3][i] * rows[3][k]
        };
        let (xy, xz, yz) = (sum(0, 1), sum(0, 2), sum(1, 2));
        let information = Matrix3::new(sum(0, 0), xy, xz, xy, sum(1, 1), yz, xz, yz, sum(2, 2));
        let pull = rows[0] * r[0] + rows[1] * r[1] + rows[2] * r[2] + rows[3] * r[3];
        Term { information, pull, cost: r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_those_of_the_inverse() {
        let j = Matrix4x3::from_fn(|i, k| (i as f64 * 1.7 + k as f64 * 0.9).sin() * 300.0);
        let r = Vector4::new(0.3, -0.2, 0.5, 0.1);
        let root = Matrix4::from_fn(|i, k| (i as f64 * 2.3 - k as f64).cos());
        let full = root * root.transpose() + Matrix4::identity() * 0.1;
        for noise in [full, Matrix4::from_diagonal(&Vector4::new(0.1, 0.2, 0.05, 0.4))] {
            let message = Whitener::of(&noise).unwrap().term(&j, &r);
            let weight = noise.try_inverse().unwrap();
            let expected = j.transpose() * weight * j;
            assert!((message.information - expected).amax() < 1e-12 * expected.amax());
            let pull = j.transpose() * weight * r;
            assert!((message.pull - pull).amax() < 1e-12 * pull.amax());
            assert!((message.cost / r.dot(&(weight * r)) - 1.0).abs() < 1e-12);
        }
        for bad in [Matrix4::zeros(), -full, full * f64::NAN] {
            assert!(Whitener::of(&bad).is_none());
        }
    }
}
