//! Tests of pose errors and bounds against NumPy.

use nalgebra::{Matrix4, Matrix6, Vector3};
use seafix_evaluation::{
    Seen, Solved, alert_limit, attitude_error, cramer_rao, lever_arm_error, mean_distance, mean_nearest_distance, nees,
    nonlinearity, position_error, residual_rms, symmetric_distance, transfer_bound, transfer_rms,
};
use seafix_geometry::{Camera, Covariance6, Frame, Object, Pinhole, Point, StereoRig, Transform, so3};

use crate::{near, numbers};

const NUMPY: &str = include_str!("../fixtures/pose.txt");

fn motions<A: Frame, B: Frame>(key: &str) -> Vec<Transform<A, B>> {
    let motion = |m: &[f64]| {
        let matrix = Matrix4::from_row_slice(&[m, &[0.0, 0.0, 0.0, 1.0]].concat());
        Transform::from_matrix(&matrix).unwrap()
    };
    numbers(NUMPY, key).chunks(12).map(motion).collect()
}

fn pose(key: &str) -> Transform<Object, Camera> {
    motions(key)[0]
}

fn points<F: Frame>(key: &str) -> Vec<Point<F>> {
    numbers(NUMPY, key).chunks(3).map(|at| Point::new(at[0], at[1], at[2])).collect()
}

/// The single number of a key.
fn number(key: &str) -> f64 {
    numbers(NUMPY, key)[0]
}

fn close(found: f64, key: &str, tolerance: f64) {
    near(&[found], &numbers(NUMPY, key), tolerance, key);
}

fn rig() -> StereoRig {
    let camera =
        Pinhole::new([640, 480], [533.4, 541.7], [342.5, 234.7], &[-0.31, 0.12, -0.0021, 0.0016, -0.018]).unwrap();
    StereoRig::new(camera, camera, motions("right from left")[0]).unwrap()
}

fn seen(with_model: bool) -> Vec<Seen> {
    let pixels = Matrix4::from_row_slice(&numbers(NUMPY, "pixels"));
    let (sigmas, scales) = (numbers(NUMPY, "model sigma"), numbers(NUMPY, "scales"));
    let point = |(i, at): (usize, Point<Object>)| Seen {
        at,
        model_sigma: if with_model { sigmas[i] } else { 0.0 },
        pixels: pixels * scales[i],
    };
    points("model").into_iter().enumerate().map(point).collect()
}

/// With lens distortion, model errors and correlated pixel errors. The test fails with 4·STEP for 2·STEP.
#[test]
fn the_bound_is_fisher_s() {
    let (rig, pose) = (rig(), pose("pose"));
    let bound = cramer_rao(&rig, &pose, &seen(true)).unwrap();
    let found: Vec<f64> = bound.matrix.iter().copied().collect();
    near(&found, &numbers(NUMPY, "bound"), 1e-7, "bound");
    close(transfer_bound(&bound, &pose, &points("model")), "transfer bound", 1e-7);
    close(nonlinearity(&rig, &pose, &seen(true), &bound).unwrap(), "nonlinearity", 1e-4);
}

/// Three visible points suffice; none of them may be behind the cameras.
#[test]
fn a_bound_needs_three_points_that_are_seen() {
    let (rig, pose, points) = (rig(), pose("pose"), seen(true));
    assert!(cramer_rao(&rig, &pose, &points[..2]).is_none());
    assert!(cramer_rao(&rig, &pose, &points[..3]).is_some());
    let mut behind = points.clone();
    behind[3].at = pose * Point::new(0.0, 0.0, -1.0);
    assert!(cramer_rao(&rig, &pose, &behind).is_none());
    let bound = cramer_rao(&rig, &pose, &points).unwrap();
    assert!(nonlinearity(&rig, &pose, &behind, &bound).is_none());
}

#[test]
fn errors_of_a_fix_are_numpy_s() {
    let (estimate, truth, model) = (pose("estimate"), pose("pose"), points("model"));
    let pairs: Vec<_> = points("noisy").into_iter().zip(model.iter().copied()).collect();
    close(residual_rms(&estimate, &pairs).unwrap(), "residual rms", 1e-13);
    close(transfer_rms(&estimate, &truth, &model).unwrap(), "transfer rms", 1e-13);
    close(mean_distance(&estimate, &truth, &model).unwrap(), "mean distance", 1e-13);
    close(position_error(&estimate, &truth), "position error", 1e-13);
    close(attitude_error(&estimate, &truth), "attitude error", 1e-12);
    let far = pose("far estimate");
    close(mean_distance(&far, &truth, &model).unwrap(), "far mean distance", 1e-13);
    close(mean_nearest_distance(&far, &truth, &model).unwrap(), "far mean nearest distance", 1e-13);
    let symmetries = motions("symmetries");
    close(symmetric_distance(&estimate, &truth, &model, &symmetries).unwrap(), "symmetric distance", 1e-13);
    close(symmetric_distance(&estimate, &truth, &model, &[]).unwrap(), "symmetric distance alone", 1e-13);
    assert_eq!(residual_rms(&estimate, &[]), None);
    let one = [Point::from(Vector3::from(truth.translation()))];
    let moved = mean_distance(&estimate, &truth, &one).unwrap();
    assert!(
        (moved - position_error(&estimate, &truth)).abs() < 1e-14,
        "the camera's own position moves with the camera"
    );
}

#[test]
fn the_normalised_error_is_numpy_s() {
    let covariance = Covariance6::new(Matrix6::from_row_slice(&numbers(NUMPY, "bound")));
    let found = nees(&pose("estimate"), &pose("pose"), &covariance, &points("centroid")[0]).unwrap();
    assert!((found / number("nees") - 1.0).abs() < 1e-8, "{found}");
    let negative = Covariance6::new(-Matrix6::identity());
    assert_eq!(nees(&pose("estimate"), &pose("pose"), &negative, &points("centroid")[0]), None);
}

/// A displacement of 3 m, and an arm of 2 m with a rotation of 60°: 9 + 8/3 (2 · sin 30°)².
#[test]
fn a_lever_arm_by_hand() {
    let found = lever_arm_error(3.0, std::f64::consts::FRAC_PI_3, 2.0);
    assert!((found - (9.0 + 8.0 / 3.0_f64).sqrt()).abs() < 1e-15);
    // 5 % of 2 m are 0.1 m.
    assert_eq!([alert_limit(1.0), alert_limit(2.0), alert_limit(3.0)], [0.05, 0.1, 0.1]);
}

/// Each criterion just below and above its limit, for a model off its origin: a rotation about the origin moves the
/// centroid.
#[test]
fn a_solved_pose_by_hand() {
    let truth = Transform::<Object, Camera>::identity();
    let moved = |x: f64, degrees: f64| {
        Transform::new(so3::exp(&Vector3::new(0.0, 0.0, degrees.to_radians())), Vector3::new(x, 0.0, 0.0))
    };
    let model = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Point::<Object>::from);
    let holds = |ideal: f64, putative: bool, estimate| {
        Solved { ideal_rms: Some(ideal), putative }.holds(&estimate, &truth, &model)
    };
    assert!(holds(0.0, false, moved(0.0499, 0.0)) && !holds(0.0, false, moved(0.0501, 0.0)));
    // The centroid at 1 m moves by 2 · sin 0.7° = 24 mm (correct) or 2 · sin 1.45° = 51 mm (wrong).
    assert!(holds(0.0, false, moved(0.0, 1.4)) && !holds(0.0, false, moved(0.0, 2.9)));
    // A rotation about the centroid itself changes the attitude only.
    let about = |degrees: f64| {
        let turn = so3::exp(&Vector3::new(0.0, 0.0, f64::to_radians(degrees)));
        Transform::new(turn, Vector3::x() - turn * Vector3::x())
    };
    assert!(holds(0.0, false, about(1.99)) && !holds(0.0, false, about(2.01)));
    assert!(holds(0.0, true, moved(0.0099, 0.0)) && !holds(0.0, true, moved(0.0101, 0.0)));
    assert!(holds(0.02, true, moved(0.0599, 0.0)) && !holds(0.02, true, moved(0.0601, 0.0)));
    assert!(holds(0.0, false, truth), "three times a zero error is zero");
}
