//! Errors of one fix: fit RMS, target registration error, position and attitude error, NEES (docs/formats.md).
//!
//! The error transform is E = object_from_camera_est · camera_from_object_true, the identity for an exact estimate.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform, so3};

/// The fit RMS (the paper's m1): RMS of ‖object_from_camera · C − P‖ over identified points (m).
///
/// It includes the noise of the evaluated points themselves. `None` without points.
pub fn residual_rms(
    object_from_camera: &Transform<Object, Camera>,
    pairs: &[(Point<Camera>, Point<Object>)],
) -> Option<f64> {
    root_mean_square(pairs.iter().map(|(c, p)| (*object_from_camera * *c).distance(p)))
}

/// The target registration error (the paper's m2): RMS of ‖E·p − p‖ over all model points (m).
///
/// `None` without points.
pub fn transfer_rms(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    model: &[Point<Object>],
) -> Option<f64> {
    let e = *estimate * truth.inverse();
    root_mean_square(model.iter().map(|p| (e * *p).distance(p)))
}

/// The position error: distance between the estimated and true position of the left camera in the object frame (m).
pub fn position_error(estimate: &Transform<Object, Camera>, truth: &Transform<Object, Camera>) -> f64 {
    (estimate.translation() - truth.translation()).norm()
}

/// The attitude error: the rotation angle of E (rad).
pub fn attitude_error(estimate: &Transform<Object, Camera>, truth: &Transform<Object, Camera>) -> f64 {
    so3::angle(&(estimate.rotation() * truth.rotation().inverse()))
}

/// The normalised estimation error squared (NEES) εᵀ Σ⁻¹ ε: χ² with six degrees of freedom for a consistent covariance.
///
/// The error is ε = (φ, displacement of the centroid of the used points), along the camera axes; the covariance is
/// transformed accordingly. The centroid is a point of the object: the one that the estimate places at `centroid`
/// (camera frame). Its displacement is measured from its true position. A point fixed in the camera's frame would also
/// move by φ times the depth error. That term is of second order, yet for a small, distant object it is as large as the
/// lateral error of the centroid. This form keeps ε χ² even if the rotation is poorly determined.
///
/// `None` if the covariance is not positive definite.
pub fn nees(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    covariance: &Covariance6<Object, Camera>,
    centroid: &Point<Camera>,
) -> Option<f64> {
    // With T_true = T_est·Exp(ξ) the point estimated at c is truly at Exp(−ξ)·c; to first order the error is φ×c + ρ.
    let step = estimate.inverse() * *truth;
    let phi = so3::log(&step.rotation());
    let moved: Vector3<f64> = *centroid - step.inverse() * *centroid;
    let mut error = Vector6::zeros();
    error.fixed_rows_mut::<3>(0).copy_from(&phi);
    error.fixed_rows_mut::<3>(3).copy_from(&moved);
    let mut transport = Matrix6::identity();
    transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&-so3::skew(&centroid.coords));
    transport.fixed_view_mut::<3, 3>(3, 3).copy_from(&Matrix3::identity());
    let information = (transport * covariance.matrix * transport.transpose()).cholesky()?;
    Some(error.dot(&information.solve(&error)))
}

/// The RMS error (m) at the distance `arm` (m) from a point with a known error.
///
/// The known point is displaced by `displacement` (m), and the estimate is rotated by `angle` (rad); the mean is over
/// all directions of the arm. With E = (R, t) and a unit vector u, ‖E(c + a·u) − (c + a·u)‖² = ‖E·c − c + a·(R −
/// I)·u‖². Averaged over u the mixed term vanishes, and the mean of ‖(R − I)·u‖² is tr((R − I)ᵀ(R − I)) / 3 =
/// 8/3·sin²(θ/2).
pub fn lever_arm_error(displacement: f64, angle: f64, arm: f64) -> f64 {
    (displacement * displacement + 8.0 / 3.0 * (arm * (0.5 * angle).sin()).powi(2)).sqrt()
}

/// The alert limit (m): 0.10 m or 5 % of the object's diameter, the smaller one. A fix with a larger error is wrong.
pub fn alert_limit(diameter: f64) -> f64 {
    (0.05 * diameter).min(0.10)
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = errors.fold((0_usize, 0.0), |(n, sum), e| (n + 1, sum + e * e));
    (n > 0).then(|| (sum / n as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, turn: f64) -> Transform<Object, Camera> {
        Transform::exp(&[0.0, 0.0, turn, 0.0, 0.0, 0.0].into())
            * Transform::<Camera, Camera>::new(so3::exp(&Vector3::zeros()), Vector3::new(x, 0.0, 2.0))
    }

    #[test]
    fn a_shift_moves_every_model_point_alike() {
        let model = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        let (a, b) = (pose(0.01, 0.0), pose(0.0, 0.0));
        assert!((transfer_rms(&a, &b, &model).unwrap() - 0.01).abs() < 1e-15);
        assert!((position_error(&a, &b) - 0.01).abs() < 1e-15);
        assert_eq!(attitude_error(&a, &b), 0.0);
        assert_eq!(transfer_rms(&a, &b, &[]), None);
    }

    #[test]
    fn a_turn_is_its_angle() {
        assert!((attitude_error(&pose(0.0, 0.3), &pose(0.0, 0.1)) - 0.2).abs() < 1e-15);
    }

    /// A rotation by 90° moves a point at one metre by √2 m or, along the axis, not at all.
    ///
    /// The test fails with 4/3 for 8/3.
    #[test]
    fn a_lever_arm_shows_the_turn() {
        let (angle, arm) = (std::f64::consts::FRAC_PI_2, 1.0);
        assert!((lever_arm_error(0.0, angle, arm) - (4.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(lever_arm_error(0.3, 0.0, 5.0), 0.3);
        let e =
            Transform::<Object, Object>::new(so3::exp(&Vector3::new(0.1, -0.2, 0.05)), Vector3::new(0.01, 0.0, -0.02));
        let c = Point::new(0.4, 0.1, -0.3);
        let moved = |p: Point<Object>| (e * p).distance(&p);
        let ends = (0..6).map(|k| {
            let mut end = c;
            end.coords[k / 2] += if k % 2 == 0 { 2.0 } else { -2.0 };
            moved(end).powi(2)
        });
        let rms = (ends.sum::<f64>() / 6.0).sqrt();
        let reported = lever_arm_error(moved(c), so3::angle(&e.rotation()), 2.0);
        assert!(
            (rms - reported).abs() < 1e-12,
            "the six ends along the axes have the sphere's mean square: {rms} {reported}"
        );
    }

    #[test]
    fn truth_scores_zero() {
        let t = pose(0.4, 0.2);
        let c = Point::new(0.1, 0.2, 3.0);
        assert!(residual_rms(&t, &[(c, t * c)]).unwrap() < 1e-15);
        assert!(nees(&t, &t, &Covariance6::isotropic(0.01, 0.02), &c).unwrap() < 1e-20);
    }

    #[test]
    fn one_sigma_off_scores_one() {
        let t = pose(0.0, 0.0);
        let truth = t.perturbed(&[0.0, 0.0, 0.0, 0.02, 0.0, 0.0].into());
        let n = nees(&t, &truth, &Covariance6::isotropic(0.01, 0.02), &Point::origin()).unwrap();
        assert!((n - 1.0).abs() < 1e-12);
    }

    /// A pose with errors of 3° and of 5 cm in depth, and an exact direction of the centroid.
    ///
    /// The rotation does not enter the displacement of the centroid.
    #[test]
    fn the_centroid_is_a_point_of_the_object() {
        let estimate = pose(0.0, 0.0);
        let seen = Point::new(0.0, 0.0, 5.0);
        let deeper = Point::new(0.0, 0.0, 5.05);
        // The true object point is at `deeper`, rotated about it.
        let turn = so3::exp(&Vector3::new(0.05, 0.0, 0.0));
        let moved = Transform::<Camera, Camera>::new(turn, seen.coords - turn * deeper.coords);
        let truth = estimate * moved;
        assert!((estimate * seen).distance(&(truth * deeper)) < 1e-12);
        let lateral = 1e-3;
        let mut about = Matrix6::from_diagonal(&[2.5e-3, 2.5e-3, 2.5e-3, 0.0, 0.0, 0.0].into());
        about
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&Matrix3::from_diagonal(&[lateral * lateral, lateral * lateral, 2.5e-3].into()));
        let mut back = Matrix6::identity();
        back.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::skew(&seen.coords));
        let covariance = Covariance6::new(back * about * back.transpose());
        let n = nees(&estimate, &truth, &covariance, &seen).unwrap();
        assert!((n - 2.0).abs() < 1e-6, "one standard deviation in attitude, one in depth: {n}");
    }

    #[test]
    fn the_limit_is_the_smaller() {
        assert_eq!(alert_limit(10.0), 0.10);
        assert_eq!(alert_limit(0.2), 0.05 * 0.2);
    }
}
