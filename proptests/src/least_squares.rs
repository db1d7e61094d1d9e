//! The minimum sum of squared residuals over all rigid motions, by a method that no solver uses.

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::scenes::Scene;

/// The minimum Σ ‖C_k H − P_k‖² (m²) over all rigid motions H, from the largest eigenvalue of Horn's 4×4 matrix and
/// without the motion (Horn, *Closed-form solution of absolute orientation using unit quaternions*, 1987).
pub fn least_squares(scene: &Scene) -> f64 {
    let count = scene.points.len() as f64;
    let known: Vector3<f64> = scene.points.iter().map(|p| p.model.coords).sum::<Vector3<f64>>() / count;
    let seen: Vector3<f64> = scene.points.iter().map(|p| p.measured.at.coords).sum::<Vector3<f64>>() / count;
    let (mut s, mut sizes) = (Matrix3::zeros(), 0.0);
    for point in &scene.points {
        let (c, p) = (point.measured.at.coords - seen, point.model.coords - known);
        s += c * p.transpose();
        sizes += c.norm_squared() + p.norm_squared();
    }
    let n = Matrix4::new(
        s.trace(),
        s.m23 - s.m32,
        s.m31 - s.m13,
        s.m12 - s.m21,
        s.m23 - s.m32,
        s.m11 - s.m22 - s.m33,
        s.m12 + s.m21,
        s.m31 + s.m13,
        s.m31 - s.m13,
        s.m12 + s.m21,
        s.m22 - s.m11 - s.m33,
        s.m23 + s.m32,
        s.m12 - s.m21,
        s.m31 + s.m13,
        s.m23 + s.m32,
        s.m33 - s.m11 - s.m22,
    );
    sizes - 2.0 * n.symmetric_eigenvalues().max()
}
