//! Tests of exponential, logarithm and Jacobians against 60-digit arithmetic.

use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform, right_jacobian_inverse, so3};

use crate::{names, near, numbers};

const SERIES: &str = include_str!("../fixtures/series.txt");

/// The test fails with 1/12, 1/48 and 1/240 in place of the series' 1/24, 1/6 and 1/120.
#[test]
fn a_turn_of_any_size_has_its_digits() {
    let mut sizes = 0;
    for size in names(SERIES, "phi ") {
        let phi = Vector3::from_vec(numbers(SERIES, &format!("phi {size}")));
        let turn = so3::exp(&phi);
        let wanted = numbers(SERIES, &format!("exp {size}"));
        // The axis is compared relative to its own size, so that small rotations are as precise as large ones.
        near(turn.imag().as_slice(), &wanted[1..], 4e-16, &format!("exp {size}"));
        assert!((turn.w - wanted[0]).abs() < 3e-16, "exp {size}: {}, expected {}", turn.w, wanted[0]);
        near(so3::log(&turn).as_slice(), phi.as_slice(), 4e-16, &format!("log {size}"));
        assert!((so3::angle(&turn) / phi.norm() - 1.0).abs() < 4e-16, "angle {size}");
        sizes += 1;
    }
    assert_eq!(sizes, 13);
}

#[test]
fn the_left_jacobian_is_its_sum() {
    for size in names(SERIES, "phi ") {
        let phi = Vector3::from_vec(numbers(SERIES, &format!("phi {size}")));
        let wanted = Matrix3::from_row_slice(&numbers(SERIES, &format!("jacobian {size}")));
        let found = so3::left_jacobian(&phi);
        // The off-diagonal terms are theta / 2 and theta^2 / 6.
        let theta = phi.norm();
        let parts = |jacobian: &Matrix3<f64>| {
            [(jacobian - jacobian.transpose()) * 0.5, (jacobian + jacobian.transpose()) * 0.5 - Matrix3::identity()]
        };
        let ([odd, even], [odd_wanted, even_wanted]) = (parts(&found), parts(&wanted));
        assert!((odd - odd_wanted).amax() < 1e-15 * theta, "{size}: {:e}", (odd - odd_wanted).amax());
        // The closed form (theta - sin theta) / theta^3 loses digits above the series; theta^2 restores them.
        assert!((even - even_wanted).amax() < 4e-16, "{size}: {:e}", (even - even_wanted).amax());
        let xi = Vector6::from_iterator(phi.iter().copied().chain([0.5, -0.7, 0.3]));
        let motion = Transform::<Object, Camera>::exp(&xi);
        near(motion.translation().as_slice(), &numbers(SERIES, &format!("carried {size}")), 4e-16, size);
        near(motion.log().as_slice(), xi.as_slice(), 3e-15, size);
    }
}

/// V's symmetric part is θ²/6 − θ⁴/120 across the rotation axis: an error of the second term is visible by itself.
#[test]
fn the_series_second_terms_are_right() {
    let theta = 9.9e-4;
    let v = so3::left_jacobian(&Vector3::new(0.0, 0.0, theta));
    // The terms (1 − cos θ)/θ and sin θ/θ.
    let wanted = (theta / 2.0 - theta.powi(3) / 24.0, 1.0 - theta * theta / 6.0 + theta.powi(4) / 120.0);
    assert!((v.m21 - wanted.0).abs() < 1e-18 && (v.m12 + wanted.0).abs() < 1e-18, "{} {}", v.m21, wanted.0);
    assert!((v.m11 - wanted.1).abs() < 2.3e-16 && (v.m22 - wanted.1).abs() < 2.3e-16 && v.m33 == 1.0);
}

#[test]
fn the_right_jacobian_has_the_inverse_of_its_sum() {
    for size in names(SERIES, "xi ") {
        let xi = Vector6::from_vec(numbers(SERIES, &format!("xi {size}")));
        let found: Vec<f64> = right_jacobian_inverse(&xi).transpose().iter().copied().collect();
        let tolerance = if size == "0.301" { 1e-14 } else { 3e-15 };
        near(&found, &numbers(SERIES, &format!("inverse {size}")), tolerance, size);
    }
}

#[test]
fn a_matrix_near_half_a_turn_keeps_its_axis() {
    use std::f64::consts::PI;
    let axis = Vector3::new(0.6, -0.48, 0.64);
    for angle in [0.0, 1e-10, 5e-10, 2e-9, 1e-5, 1.0, 2.09, 2.1, 3.0, PI - 1e-6, PI] {
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(axis), angle);
        let found = so3::log_of_matrix(turn.matrix());
        let off = (found - axis * angle).norm();
        // A rotation by π has two axes of opposite sign.
        let off = if angle == PI { off.min((found + axis * angle).norm()) } else { off };
        assert!(off < 1e-15 + 4e-15 * angle, "{angle}: {found} {off:e}");
    }
}

/// Both signs of a quaternion are the same rotation.
#[test]
fn the_long_orientation_is_not_taken() {
    let turn = so3::exp(&Vector3::new(0.0, 0.0, 1.5 * std::f64::consts::PI));
    assert!((so3::log(&turn).z + 0.5 * std::f64::consts::PI).abs() < 1e-15);
    assert!((so3::angle(&turn) - 0.5 * std::f64::consts::PI).abs() < 1e-15);
}

/// The identity has no axis; a rotation by π has two, and the quaternion selects one.
#[test]
fn the_ends_of_the_logarithm() {
    let half = |w: f64, axis: Vector3<f64>| {
        so3::log(&UnitQuaternion::new_unchecked(nalgebra::Quaternion::from_parts(w, axis)))
    };
    assert_eq!(half(1.0, Vector3::zeros()), Vector3::zeros());
    assert_eq!(half(-1.0, Vector3::zeros()), Vector3::zeros());
    assert_eq!(half(0.0, Vector3::x()), Vector3::x() * std::f64::consts::PI);
    assert_eq!(half(-0.0, -Vector3::x()), -Vector3::x() * std::f64::consts::PI);
    assert_eq!(so3::log_of_matrix(&Matrix3::identity()), Vector3::zeros());
    assert_eq!(so3::exp(&Vector3::zeros()), UnitQuaternion::identity());
    assert_eq!(right_jacobian_inverse(&Vector6::zeros()), nalgebra::Matrix6::identity());
    assert_eq!(Transform::<Object, Camera>::identity().log(), Vector6::zeros());
}
