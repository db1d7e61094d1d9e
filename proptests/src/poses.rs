//! Rotations and rigid motions.

use std::f64::consts::{PI, TAU};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;
use seafix_geometry::{Frame, Transform, so3};

/// Unit vectors, uniform over the sphere.
pub fn direction() -> impl Strategy<Value = Vector3<f64>> {
    (-1.0..=1.0, 0.0..TAU).prop_map(|(z, turn): (f64, f64)| {
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vector3::new(r * turn.cos(), r * turn.sin(), z).normalize()
    })
}

/// Rotations by an angle (rad) of this range about any axis.
pub fn turn(angles: impl Strategy<Value = f64>) -> impl Strategy<Value = UnitQuaternion<f64>> {
    (direction(), angles).prop_map(|(axis, angle)| so3::exp(&(axis * angle)))
}

/// Rotations: mostly uniform (Shoemake, *Uniform random rotations*, 1992), sometimes the identity, a small rotation, a
/// half-turn, or nearly one.
pub fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    let uniform = (0.0..=1.0, 0.0..TAU, 0.0..TAU).prop_map(|(u, a, b): (f64, f64, f64)| {
        let (s, c) = ((1.0 - u).sqrt(), u.sqrt());
        UnitQuaternion::new_normalize(Quaternion::new(c * b.cos(), s * a.sin(), s * a.cos(), c * b.sin()))
    });
    prop_oneof![
        12 => uniform,
        1 => Just(UnitQuaternion::identity()),
        1 => turn(0.0..1e-6),
        1 => turn(Just(PI)),
        1 => turn(PI - 1e-6..PI),
    ]
}

/// Vectors with coordinates within ±`reach` (m).
pub fn vector(reach: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-reach..=reach).prop_map(Vector3::from)
}

/// Rigid motions with any rotation and a translation within ±`reach` (m) on each axis.
pub fn pose<A: Frame, B: Frame>(reach: f64) -> impl Strategy<Value = Transform<A, B>> {
    (rotation(), vector(reach)).prop_map(|(rotation, translation)| Transform::new(rotation, translation))
}

/// The difference of two motions: the angle between them (rad) and the distance of their translations (m).
pub fn apart<A: Frame, B: Frame>(a: &Transform<A, B>, b: &Transform<A, B>) -> (f64, f64) {
    (so3::angle(&(a.rotation().inverse() * b.rotation())), (a.translation() - b.translation()).norm())
}
