//! The angle between lines of sight.

use nalgebra::Vector3;

/// The largest angle between two of the rays (rad).
pub(super) fn largest_angle(rays: &[Vector3<f64>]) -> f64 {
    let pairs = rays.iter().enumerate().flat_map(|(k, a)| rays[..k].iter().map(move |b| a.angle(b)));
    pairs.fold(0.0, f64::max)
}
