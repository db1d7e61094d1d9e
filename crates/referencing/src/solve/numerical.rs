//! The covariance of any solver's answer, by central differences through the solver.

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels};

use super::Degenerate;
use crate::Observations;

/// The step (m) of the differences: rounding (1e-15 of the coordinates over the step) and the
/// third derivative (the step squared) are then both below 1e-9 of the result.
const STEP: f64 = 1e-5;

/// Σ = Σ_i J_i Σ_i J_iᵀ over every measured point (its covariance) and every model point (σ² I), where
/// J_i = ∂ξ/∂point_i and ξ is the change of the answer, `solve(moved) = at · Exp(ξ)`.
///
/// Where a point has pixels they move with it, so that a solver that looks only at pixels is
/// differentiated too.
pub(super) fn covariance(
    solve: impl Fn(&Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>,
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let mut sum = Matrix6::zeros();
    let mut moved = data.clone();
    for i in 0..data.points.len() {
        let original = data.points[i];
        if original.measured.covariance != Matrix3::zeros() {
            let j = jacobian(at, |step| {
                moved.points[i].measured.at = original.measured.at + step;
                moved.points[i].pixels = data.rig.map_or(original.pixels, |rig| {
                    original.pixels.map(|seen| {
                        let at = shifted(rig, seen.at, &original.measured.at, &step);
                        UncertainPixels { at, ..seen }
                    })
                });
                let answer = solve(&moved);
                moved.points[i] = original;
                answer
            })?;
            sum += j * original.measured.covariance * j.transpose();
        }
        if original.model_sigma > 0.0 {
            let j = jacobian(at, |step| {
                moved.points[i].model = original.model + step;
                let answer = solve(&moved);
                moved.points[i] = original;
                answer
            })?;
            sum += j * j.transpose() * original.model_sigma.powi(2);
        }
    }
    Ok(Covariance6::new(sum))
}

/// ∂ξ/∂step at step 0.
fn jacobian(
    at: &Transform<Object, Camera>,
    mut answer: impl FnMut(Vector3<f64>) -> Result<Transform<Object, Camera>, Degenerate>,
) -> Result<Matrix6x3<f64>, Degenerate> {
    let mut j = Matrix6x3::zeros();
    for axis in 0..3 {
        let step = Vector3::ith(axis, STEP);
        let (plus, minus): (Vector6<f64>, Vector6<f64>) = (at.error_to(&answer(step)?), at.error_to(&answer(-step)?));
        j.set_column(axis, &((plus - minus) / (2.0 * STEP)));
    }
    Ok(j)
}

/// The pixels when the point they show moves by `step`.
fn shifted(rig: &StereoRig, pixels: StereoPixels, from: &Point<Camera>, step: &Vector3<f64>) -> StereoPixels {
    let (Some(before), Some(after)) = (rig.project(from), rig.project(&(*from + *step))) else { return pixels };
    let by = |pixel: Pixel, before: Pixel, after: Pixel| Pixel {
        u: pixel.u + after.u - before.u,
        v: pixel.v + after.v - before.v,
    };
    StereoPixels { left: by(pixels.left, before.left, after.left), right: by(pixels.right, before.right, after.right) }
}
