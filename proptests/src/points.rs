//! Points and triangles of points.

use nalgebra::Vector3;
use proptest::prelude::*;
use seafix_geometry::{Frame, Point};

use crate::poses::{rotation, vector};

/// Points with coordinates within ±`reach` (m).
pub fn point<F: Frame>(reach: f64) -> impl Strategy<Value = Point<F>> {
    vector(reach).prop_map(Point::from)
}

/// Triangles with two sides of 0.3 to 10 m and sines of all angles of at least 1e-3 (the thinnest base of a site file),
/// the first corner within ±50 m on each axis; one in three is thin.
pub fn triangle<F: Frame>() -> impl Strategy<Value = [Point<F>; 3]> {
    let angle = prop_oneof![2 => 0.05..3.0, 1 => (-2.9..-1.0).prop_map(|e: f64| 10f64.powf(e))];
    (vector(50.0), rotation(), 0.3..10.0, 0.3..10.0, angle)
        .prop_map(|(first, rotation, a, b, angle): (_, _, f64, f64, f64)| {
            let second = Vector3::new(a, 0.0, 0.0);
            let third = Vector3::new(b * angle.cos(), b * angle.sin(), 0.0);
            [first, first + rotation * second, first + rotation * third].map(Point::from)
        })
        .prop_filter("thinner than a base may be", |corners| sine_of_smallest_angle(corners) >= 1e-3)
}

/// The sine of a triangle's smallest angle.
pub fn sine_of_smallest_angle<F: Frame>(corners: &[Point<F>; 3]) -> f64 {
    let at = |i: usize| {
        let (u, v) = (corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]);
        u.cross(&v).norm() / (u.norm() * v.norm())
    };
    at(0).min(at(1)).min(at(2))
}
