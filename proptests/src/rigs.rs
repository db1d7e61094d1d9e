//! Stereo rigs and points in their view.

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use seafix_geometry::{Camera, Pinhole, Point, StereoRig, Transform};

use crate::poses::turn;

/// Maximum depth of a point (m).
pub const FARTHEST: f64 = 20.0;
/// Minimum focal length times baseline of a rig (px m).
pub const MIN_FB: f64 = 50.0;

/// Cameras of 1024 to 4096 × 768 to 3072 px, 53 to 102 degrees wide, with the principal point near the middle.
fn pinhole(distortion: Vec<f64>) -> impl Strategy<Value = Pinhole> {
    (1u32..=4, 0.4..1.0, 0.98..1.02, 0.45..0.55, 0.45..0.55).prop_map(move |(scale, widths, aspect, x, y)| {
        let size = [1024 * scale, 768 * scale];
        let f = widths * f64::from(size[0]);
        let principal = [f64::from(size[0]) * x, f64::from(size[1]) * y];
        Pinhole::new(size, [f, f * aspect], principal, &distortion).expect("the ranges are those of real cameras")
    })
}

/// Rigs of two equal cameras without distortion, side by side on x.
pub fn rectified() -> impl Strategy<Value = StereoRig> {
    (pinhole(Vec::new()), 1.0..4.0).prop_map(|(camera, fold): (Pinhole, f64)| {
        let baseline = Vector3::new(-fold * MIN_FB / camera.focal()[0], 0.0, 0.0);
        let right_from_left = Transform::new(UnitQuaternion::identity(), baseline);
        StereoRig::new(camera, camera, right_from_left).expect("the baseline is long")
    })
}

/// Rigs of two different cameras with mild lens distortion of 4, 5 or 8 coefficients. The second is displaced in any
/// direction across the axis (vertical baselines included) and a little along it, and rotated by up to 15 degrees about
/// any axis.
pub fn general() -> impl Strategy<Value = StereoRig> {
    let lens = || {
        let coefficient = |limit: f64| -limit..=limit;
        let all = (
            coefficient(0.2),
            coefficient(0.05),
            coefficient(1e-3),
            coefficient(1e-3),
            coefficient(0.02),
            coefficient(0.05),
            coefficient(0.01),
            coefficient(1e-3),
        );
        (all, prop::sample::select(vec![0usize, 4, 5, 8])).prop_flat_map(|((a, b, c, d, e, f, g, h), length)| {
            let numbers = [a, b, c, d, e, f, g, h];
            pinhole(numbers[..length].to_vec())
        })
    };
    (lens(), lens(), 1.0..4.0, 0.0..std::f64::consts::TAU, -0.3..0.3, turn(0.0..0.26)).prop_map(
        |(left, right, fold, around, along, rotation): (Pinhole, Pinhole, f64, f64, f64, _)| {
            let [fl, fr] = [left.focal(), right.focal()];
            let f = fl[0].min(fl[1]).min(fr[0]).min(fr[1]);
            let away = Vector3::new(around.cos(), around.sin(), along) * (fold * MIN_FB / f);
            StereoRig::new(left, right, Transform::new(rotation, -(rotation * away))).expect("the baseline is long")
        },
    )
}

/// Pixels of the left image with depths; the law decides whether the other camera sees the point.
pub fn seen_by_left() -> impl Strategy<Value = (f64, f64, f64)> {
    (0.0..=1.0, 0.0..=1.0, 0.3..=FARTHEST)
}

/// The point at these fractions of the left image's width and height, at depth `z` (m), if the lens model has one.
pub fn point_at(rig: &StereoRig, (across, down, z): (f64, f64, f64)) -> Option<Point<Camera>> {
    let [width, height] = rig.left().size().map(|pixels| f64::from(pixels - 1));
    let direction = rig.left().normalize(&seafix_geometry::Pixel { u: across * width, v: down * height })?;
    Some(Point::from(direction.push(1.0) * z))
}
