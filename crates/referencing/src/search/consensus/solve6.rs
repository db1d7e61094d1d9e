//! Systems of six equations, which dominate the time of the fits.

use nalgebra::{Cholesky, Matrix6, U6, Vector6};

/// The Cholesky factor of a matrix, from its lower triangle.
///
/// Bit for bit equal to nalgebra's, whose loops over six rows are not unrolled.
#[inline]
pub(super) fn factor(matrix: &Matrix6<f64>) -> Option<Cholesky<f64, U6>> {
    let mut l = *matrix;
    for j in 0..6 {
        for k in 0..j {
            let factor = -l[(j, k)];
            for i in j..6 {
                l[(i, j)] += factor * l[(i, k)];
            }
        }
        // The negated comparison rejects NaN too.
        if !(l[(j, j)] > 0.0) {
            return None;
        }
        let root = l[(j, j)].sqrt();
        l[(j, j)] = root;
        for i in j + 1..6 {
            l[(i, j)] /= root;
        }
    }
    Some(Cholesky::pack_dirty(l))
}

/// The solution with this factor, bit for bit equal to nalgebra's.
#[inline]
pub(super) fn solve(factor: &Cholesky<f64, U6>, of: &Vector6<f64>) -> Vector6<f64> {
    let (l, mut x) = (factor.l_dirty(), *of);
    for i in 0..6 {
        x[i] /= l[(i, i)];
        for k in i + 1..6 {
            x[k] -= x[i] * l[(k, i)];
        }
    }
    for i in (0..6).rev() {
        let sum = (i + 1..6).fold(0.0, |sum, k| sum + l[(k, i)] * x[k]);
        x[i] = (x[i] - sum) / l[(i, i)];
    }
    x
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn it_agrees_with_nalgebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for round in 0..1000 {
            let a = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
            // Some matrices are indefinite.
            let matrix = a * a.transpose() - Matrix6::identity() * if round % 7 == 0 { 0.1 } else { 0.0 };
            let of = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let (own, known) = (factor(&matrix), matrix.cholesky());
            assert_eq!(own.is_some(), known.is_some());
            let (Some(own), Some(known)) = (own, known) else { continue };
            assert_eq!(own.l(), known.l());
            assert_eq!(solve(&own, &of), known.solve(&of));
        }
    }

    #[test]
    fn what_is_not_positive_has_no_factor() {
        assert!(factor(&Matrix6::zeros()).is_none());
        assert!(factor(&Matrix6::from_element(f64::NAN)).is_none());
        assert!(factor(&-Matrix6::identity()).is_none());
    }
}
