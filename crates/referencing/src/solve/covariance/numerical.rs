//! The covariance of any solver's answer, by central differences through the solver.

use nalgebra::{Matrix3, Matrix4, Matrix4x3, Matrix6, SMatrix, SVector, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Pixel, StereoPixels, StereoRig, Transform, UncertainPixels};

use crate::{
    observations::{Observation, Observations},
    solve::{degeneracy::Degenerate, likelihood::pixel_terms::PIXEL_FLOOR},
};

/// Longest step (m) of the differences; rounding (1e-15 of the coordinates over the step) and the third derivative
/// (squared step) are then below 1e-9 of the result.
const STEP: f64 = 1e-5;
/// Longest step of pixel coordinates (px).
const PIXEL_STEP: f64 = 1e-3;
/// Largest step as a fraction of the noise; beyond its noise a solver's derivative differs from that within.
const FRACTION: f64 = 0.1;
/// Shortest step relative to the coordinates; rounding then affects no more than the fifth digit.
const SHORTEST: f64 = 1e-10;

/// The step for coordinates of this size and noise, at most `longest`.
fn step(longest: f64, sigma: f64, coordinates: f64) -> f64 {
    (FRACTION * sigma).min(longest).max(SHORTEST * coordinates)
}

/// The smallest standard deviation of a coordinate.
fn min<const N: usize>(covariance: &SMatrix<f64, N, N>) -> f64 {
    (0..N).map(|i| covariance[(i, i)]).fold(f64::INFINITY, f64::min).max(0.0).sqrt()
}

/// The covariance Σ = Σ_i J_i Σ_i J_iᵀ over every measured point and every model point.
///
/// A model point has the covariance σ² I. J_i = ∂ξ/∂point_i, with ξ the change of the answer, `solve(moved) = at ·
/// Exp(ξ)`. With pixels and a rig, the four pixel coordinates are the measurement: they are moved one by one, and the
/// triangulated point with them, so that solvers of pixels and of points are differentiated alike.
pub(crate) fn covariance(
    solve: impl Fn(&Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>,
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let mut sum = Matrix6::zeros();
    let mut moved = data.clone();
    for i in 0..data.points.len() {
        let original = data.points[i];
        let digits = original.digits();
        let reach = original.measured.at.coords.amax().max(original.model.coords.amax());
        let mut answer = |point: Observation| {
            moved.points[i] = point;
            let answer = solve(&moved);
            moved.points[i] = original;
            answer
        };
        match (original.pixels, data.rig.and_then(|rig| by_pixels(rig, &original))) {
            (Some(pixels), Some(by_pixels)) => {
                let size = step(PIXEL_STEP, min(&pixels.covariance), pixels.at.coordinates().amax());
                let j = jacobian(at, size, |step: Vector4<f64>| {
                    let mut point = original;
                    point.measured.at = original.measured.at + by_pixels * step;
                    point.pixels = Some(UncertainPixels { at: shifted(&pixels.at, &step), ..pixels });
                    answer(point)
                })?;
                let floor = Matrix4::identity() * (PIXEL_FLOOR * PIXEL_FLOOR);
                sum += j * (pixels.covariance + floor) * j.transpose();
            }
            _ => {
                let size = step(STEP, min(&original.measured.covariance).max(digits), reach);
                let j = jacobian(at, size, |step: Vector3<f64>| {
                    let mut point = original;
                    point.measured.at = original.measured.at + step;
                    answer(point)
                })?;
                let floor = Matrix3::identity() * (digits * digits);
                sum += j * (original.measured.covariance + floor) * j.transpose();
            }
        }
        if original.model_sigma > 0.0 {
            let size = step(STEP, original.model_sigma, reach);
            let j = jacobian(at, size, |step: Vector3<f64>| {
                let mut point = original;
                point.model = original.model + step;
                answer(point)
            })?;
            sum += j * j.transpose() * original.model_sigma.powi(2);
        }
    }
    Ok(Covariance6::new(sum))
}

/// σ ∂ξ/∂P of each model point P.
pub(crate) fn model_errors(
    solve: impl Fn(&Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>,
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
    let mut moved = data.clone();
    let mut of = |i: usize| {
        let original = data.points[i];
        if original.model_sigma == 0.0 {
            return Ok(SMatrix::zeros());
        }
        let reach = original.measured.at.coords.amax().max(original.model.coords.amax());
        let j = jacobian(at, step(STEP, original.model_sigma, reach), |step: Vector3<f64>| {
            moved.points[i].model = original.model + step;
            let answer = solve(&moved);
            moved.points[i] = original;
            answer
        })?;
        Ok(j * original.model_sigma)
    };
    (0..data.points.len()).map(&mut of).collect()
}

/// ∂ξ/∂step at step 0.
fn jacobian<const N: usize>(
    at: &Transform<Object, Camera>,
    size: f64,
    mut answer: impl FnMut(SVector<f64, N>) -> Result<Transform<Object, Camera>, Degenerate>,
) -> Result<SMatrix<f64, 6, N>, Degenerate> {
    let mut j = SMatrix::<f64, 6, N>::zeros();
    for axis in 0..N {
        let mut step = SVector::<f64, N>::zeros();
        step[axis] = size;
        let (plus, minus): (Vector6<f64>, Vector6<f64>) = (at.error_to(&answer(step)?), at.error_to(&answer(-step)?));
        j.set_column(axis, &((plus - minus) / (2.0 * size)));
    }
    Ok(j)
}

/// The derivative of the triangulated point by its pixels, (Jᵀ W J)⁻¹ Jᵀ W.
fn by_pixels(rig: &StereoRig, point: &Observation) -> Option<SMatrix<f64, 3, 4>> {
    let weight = point.pixels?.covariance.try_inverse()?;
    let (_, j): (_, Matrix4x3<f64>) = rig.project_with_jacobian(&point.measured.at)?;
    Some((j.transpose() * weight * j).try_inverse()? * j.transpose() * weight)
}

fn shifted(pixels: &StereoPixels, step: &Vector4<f64>) -> StereoPixels {
    let by = |pixel: &Pixel, u: f64, v: f64| Pixel { u: pixel.u + u, v: pixel.v + v };
    StereoPixels { left: by(&pixels.left, step[0], step[1]), right: by(&pixels.right, step[2], step[3]) }
}
