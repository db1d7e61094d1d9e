//! Errors of an object's model.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::trajectory::{Alignment, Pose, UndeterminedAlignment, align};

/// The differences of two models of one object after the best rigid alignment.
#[derive(Debug, Clone)]
pub struct ModelDifference {
    /// The alignment of the built model: rotation and translation onto the reference.
    pub alignment: Alignment,
    /// Built minus reference of each point (m), in the axes of the reference.
    pub differences: Vec<Vector3<f64>>,
    /// The RMS of a coordinate (m).
    pub rms: f64,
    /// The index of the point with the largest difference.
    pub worst: usize,
    /// The scale of the built model relative to the reference.
    pub scale: f64,
    /// The standard deviation of the scale.
    pub scale_sigma: f64,
    /// The weighted sum of squares after the alignment, χ² with [`dof`](Self::dof) degrees of freedom if the covariance
    /// is correct; `None` for a covariance that is not positive definite.
    pub chi2: Option<f64>,
    /// The degrees of freedom, 3n − 6.
    pub dof: usize,
}

/// Compares the `built` positions (m) of n points with the `reference`.
///
/// `covariance` is that of all 3n differences (m²), in the axes of the reference; errors of both models add. The
/// alignment of [`differences`](ModelDifference::differences) weighs all points equally. χ² is the minimum of
/// (d − G ξ)ᵀ Σ⁻¹ (d − G ξ) over the six parameters ξ of a rigid motion, and the scale is a seventh parameter in the same
/// equations, so neither depends on the frames of the models. Without a valid covariance all coordinates have the
/// variance of the residuals.
///
/// # Errors
/// [`UndeterminedAlignment`] with fewer than three points, or with points on a line.
///
/// # Panics
/// If the models differ in length or the covariance has another size.
pub fn compare_models(
    reference: &[Vector3<f64>],
    built: &[Vector3<f64>],
    covariance: &DMatrix<f64>,
) -> Result<ModelDifference, UndeterminedAlignment> {
    let n = reference.len();
    assert_eq!(covariance.shape(), (3 * n, 3 * n), "a covariance of all coordinates");
    let poses = |points: &[Vector3<f64>]| -> Vec<Pose> {
        points.iter().map(|position| Pose { position: *position, ..Pose::IDENTITY }).collect()
    };
    let alignment = align(&poses(reference), &poses(built), false)?;
    let moved: Vec<Vector3<f64>> = built.iter().map(|p| alignment.rotation * p + alignment.translation).collect();
    let differences: Vec<Vector3<f64>> = moved.iter().zip(reference).map(|(a, b)| a - b).collect();
    let squares: f64 = differences.iter().map(Vector3::norm_squared).sum();
    let dof = (3 * n).saturating_sub(6);
    let farthest = (0..n).max_by(|&a, &b| differences[a].norm_squared().total_cmp(&differences[b].norm_squared()));

    let centre = reference.iter().sum::<Vector3<f64>>() / n as f64;
    let mut design = DMatrix::zeros(3 * n, 7);
    for (k, point) in reference.iter().enumerate() {
        let arm = point - centre;
        design.fixed_view_mut::<3, 3>(3 * k, 0).copy_from(&-arm.cross_matrix());
        design.fixed_view_mut::<3, 3>(3 * k, 3).copy_from(&Matrix3::identity());
        design.fixed_view_mut::<3, 1>(3 * k, 6).copy_from(&arm);
    }
    let given = DVector::from_iterator(3 * n, differences.iter().flat_map(|d| [d.x, d.y, d.z]));
    let factor = covariance.clone().cholesky();
    let chi2 = factor.as_ref().and_then(|factor| {
        let (_, _, squares) = fitted(factor.l(), &design.columns(0, 6).into_owned(), &given)?;
        Some(squares)
    });
    let plain = (squares / dof.max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
    let lower = factor.map_or_else(|| DMatrix::identity(3 * n, 3 * n) * plain, |factor| factor.l());
    let (scale, scale_sigma) = fitted(lower, &design, &given)
        .map_or((1.0, f64::INFINITY), |(parameters, spread, _)| (1.0 + parameters[6], spread[(6, 6)].sqrt()));
    let rms = (squares / (3 * n) as f64).sqrt();
    Ok(ModelDifference { alignment, differences, rms, worst: farthest.unwrap_or(0), scale, scale_sigma, chi2, dof })
}

/// The generalised least squares of `given` by `design` with the covariance L Lᵀ: parameters, their covariance, and the
/// weighted sum of squares.
fn fitted(
    lower: DMatrix<f64>,
    design: &DMatrix<f64>,
    given: &DVector<f64>,
) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let (white, seen) = (lower.solve_lower_triangular(design)?, lower.solve_lower_triangular(given)?);
    let normal = (white.transpose() * &white).cholesky()?;
    let parameters = normal.solve(&(white.transpose() * &seen));
    let squares = (seen - white * &parameters).norm_squared();
    Some((parameters, normal.inverse(), squares))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn points() -> Vec<Vector3<f64>> {
        let at = |k: usize| {
            let t = k as f64;
            Vector3::new(libm::sin(1.3 * t), libm::cos(2.1 * t) * 0.7, libm::sin(0.4 * t * t) * 0.5)
        };
        (0..8).map(at).collect()
    }

    #[test]
    fn a_moved_model_is_the_same_and_a_scaled_one_is_not() {
        let reference = points();
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 2.0);
        let moved = |scale: f64| -> Vec<Vector3<f64>> {
            reference.iter().map(|p| turn * p * scale + Vector3::new(4.0, -2.0, 1.0)).collect()
        };
        let covariance = DMatrix::identity(24, 24) * 1e-6;
        let same = compare_models(&reference, &moved(1.0), &covariance).unwrap();
        assert!(same.rms < 1e-14 && same.chi2.unwrap() < 1e-15 && (same.scale - 1.0).abs() < 1e-13, "{same:?}");
        assert_eq!(same.dof, 18);
        let scaled = compare_models(&reference, &moved(1.002), &covariance).unwrap();
        assert!((scaled.scale - 1.002).abs() < 1e-9, "{}", scaled.scale);
        // σ of the scale is σ of a coordinate over the root of the points' squared distances from their centre.
        let centre = reference.iter().sum::<Vector3<f64>>() / 8.0;
        let arm: f64 = reference.iter().map(|p| (p - centre).norm_squared()).sum();
        assert!((scaled.scale_sigma - 1e-3 / arm.sqrt()).abs() < 1e-9);
        assert!((scaled.chi2.unwrap() - (0.002f64 / scaled.scale_sigma).powi(2)).abs() < 1e-6);
    }

    #[test]
    fn the_farthest_point_is_named() {
        let reference = points();
        let mut built = reference.clone();
        built[5].z += 0.01;
        let found = compare_models(&reference, &built, &DMatrix::identity(24, 24)).unwrap();
        assert_eq!(found.worst, 5);
        assert!(compare_models(&reference[..2], &built[..2], &DMatrix::identity(6, 6)).is_err());
        assert!(compare_models(&reference, &built, &DMatrix::zeros(24, 24)).unwrap().chi2.is_none());
    }
}
