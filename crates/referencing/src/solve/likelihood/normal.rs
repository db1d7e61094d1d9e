//! The normal equations of a motion from points with information matrices.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::solve::degeneracy::Degenerate;

/// Σ Jᵀ W J over points p with J = \[ \[p\]×, −I \]: in blocks, −\[p\]× W \[p\]×, \[p\]× W and W.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Normal {
    turn: Matrix3<f64>,
    mixed: Matrix3<f64>,
    shift: Matrix3<f64>,
}

impl Normal {
    /// Adds a point with its symmetric information matrix.
    #[inline]
    pub(crate) fn add(&mut self, at: &Vector3<f64>, information: &Matrix3<f64>) {
        let w = information;
        let (x, y, z) = (at.x, at.y, at.z);
        // [p]× W, row by row.
        let lever = |i: usize| {
            let (w0, w1, w2) = (w[(0, i)], w[(1, i)], w[(2, i)]);
            [w2 * y - w1 * z, w0 * z - w2 * x, w1 * x - w0 * y]
        };
        let (a, b, c) = (lever(0), lever(1), lever(2));
        // −L [p]×, symmetric: each row is the cross product p × row.
        let (xx, xy, xz) = (c[0] * y - b[0] * z, a[0] * z - c[0] * x, b[0] * x - a[0] * y);
        let (yy, yz, zz) = (a[1] * z - c[1] * x, b[1] * x - a[1] * y, b[2] * x - a[2] * y);
        self.turn += Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        self.mixed += Matrix3::from_columns(&[a.into(), b.into(), c.into()]);
        self.shift += w;
    }

    /// Adds the sums of `other`.
    pub(crate) fn join(&mut self, other: &Self) {
        self.turn += other.turn;
        self.mixed += other.mixed;
        self.shift += other.shift;
    }

    /// Subtracts the sums of `other`.
    pub(crate) fn remove(&mut self, other: &Self) {
        self.turn -= other.turn;
        self.mixed -= other.mixed;
        self.shift -= other.shift;
    }

    /// The sums whose matrix this symmetric one is.
    pub(crate) fn of_matrix(all: &Matrix6<f64>) -> Self {
        let block = |row: usize, column: usize| all.fixed_view::<3, 3>(row, column).into_owned();
        Self { turn: block(0, 0), mixed: block(0, 3), shift: block(3, 3) }
    }

    pub(crate) fn matrix(&self) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.turn);
        all.fixed_view_mut::<3, 3>(0, 3).copy_from(&self.mixed);
        all.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.mixed.transpose());
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.shift);
        all
    }

    /// The solution ξ of (N + damping · diag N) ξ = `gradient`; `None` if the matrix is not positive definite.
    pub(crate) fn solve(&self, damping: f64, gradient: &Vector6<f64>) -> Option<Vector6<f64>> {
        let n = self.matrix();
        let mut l = Matrix6::zeros();
        let mut inverse = [0.0; 6];
        for j in 0..6 {
            let mut pivot = n[(j, j)] * (1.0 + damping);
            for k in 0..j {
                pivot -= l[(j, k)] * l[(j, k)];
            }
            if !(pivot > 0.0) {
                return None;
            }
            inverse[j] = 1.0 / pivot.sqrt();
            for i in j + 1..6 {
                let mut sum = n[(i, j)];
                for k in 0..j {
                    sum -= l[(i, k)] * l[(j, k)];
                }
                l[(i, j)] = sum * inverse[j];
            }
        }
        let mut x = *gradient;
        for i in 0..6 {
            for k in 0..i {
                x[i] -= l[(i, k)] * x[k];
            }
            x[i] *= inverse[i];
        }
        for i in (0..6).rev() {
            for k in i + 1..6 {
                x[i] -= l[(k, i)] * x[k];
            }
            x[i] *= inverse[i];
        }
        Some(x)
    }
}

/// The inverse of an information matrix.
///
/// # Errors
///
/// [`Degenerate::Singular`] if it is not positive definite.
pub(crate) fn inverse(information: &Matrix6<f64>) -> Result<Matrix6<f64>, Degenerate> {
    information.cholesky().map(|root| root.inverse()).ok_or_else(|| singular(information))
}

/// The error for a matrix without a Cholesky factor.
///
/// It states the smallest eigenvalue after scaling the diagonal to ones.
pub(crate) fn singular(information: &Matrix6<f64>) -> Degenerate {
    let root = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = information.component_mul(&(root * root.transpose()));
    // The eigenvalue iteration of a matrix that is not finite would not end.
    let fraction = if scaled.iter().all(|x| x.is_finite()) { scaled.symmetric_eigenvalues().min() } else { f64::NAN };
    Degenerate::Singular { fraction, min: rounding(6) }
}

/// The smallest eigenvalue of a unit-diagonal matrix that guarantees a Cholesky factor.
///
/// (Demmel, *On floating point errors in Cholesky*, 1989.)
pub(crate) fn rounding(rows: usize) -> f64 {
    (rows * (rows + 1)) as f64 * f64::EPSILON
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3x6;
    use seafix_geometry::so3::skew;

    #[test]
    fn blocks_and_solution_are_those_of_the_definition() {
        let mut all = Normal::default();
        let mut expected = Matrix6::zeros();
        for k in 0..4 {
            let at = Vector3::new(f64::from(k), f64::from(k * k) - 2.0, 3.0 + f64::from(k % 2));
            let root = Matrix3::new(1.0, 0.2, 0.1, 0.0, 2.0, f64::from(k) * 0.3, 0.0, 0.0, 0.5);
            let w = root * root.transpose();
            all.add(&at, &w);
            let mut j = Matrix3x6::zeros();
            j.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&at));
            j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
            expected += j.transpose() * w * j;
        }
        assert!((all.matrix() - expected).amax() < 1e-12 * expected.amax());
        let g = Vector6::new(1.0, -2.0, 0.5, 3.0, -0.1, 0.7);
        let damped = expected + Matrix6::from_diagonal(&(expected.diagonal() * 0.3));
        assert!((damped * all.solve(0.3, &g).unwrap() - g).amax() < 1e-10);
        assert_eq!(Normal::default().solve(0.0, &g), None);
        assert!((inverse(&expected).unwrap() * expected - Matrix6::identity()).amax() < 1e-10);
    }

    /// Collinear points leave the rotation about their line undetermined.
    #[test]
    fn what_has_no_inverse_is_rejected_with_its_smallest_eigenvalue() {
        let mut line = Normal::default();
        for k in 0..4 {
            line.add(&Vector3::new(f64::from(k), 0.0, 0.0), &(Matrix3::identity() * 1e6));
        }
        for bad in [line.matrix(), Matrix6::zeros()] {
            let Err(Degenerate::Singular { fraction, min }) = inverse(&bad) else { panic!("it has none") };
            assert!(fraction.abs() <= min && min < 1e-14, "{fraction} {min}");
        }
        let Err(Degenerate::Singular { fraction, .. }) = inverse(&(line.matrix() * f64::INFINITY)) else {
            panic!("none")
        };
        assert!(fraction.is_nan());
    }
}
