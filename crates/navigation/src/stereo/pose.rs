//! The pose of a pair from the landmarks found in it.

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, StereoRig, Transform, World};

use super::landmark::project;

/// A landmark found in a new pair.
pub(super) struct Found {
    /// The pose of its key frame.
    pub(super) world_from_anchor: Transform<World, Camera>,
    /// (x, y, w) there.
    pub(super) at: Vector3<f64>,
    /// Their covariance.
    pub(super) covariance: Matrix3<f64>,
    /// Where the new images show it.
    pub(super) pixels: Vector4<f64>,
    /// The covariance of that (px²).
    pub(super) noise: Matrix4<f64>,
}

/// A pose and what agrees with it.
pub(super) struct Pose {
    pub(super) world_from_camera: Transform<World, Camera>,
    /// Of ξ in `world_from_camera · Exp(ξ)`, the landmarks' key frames taken as exact.
    pub(super) covariance: Matrix6<f64>,
    /// Whether each landmark agrees.
    pub(super) agrees: Vec<bool>,
}

/// Where the loss turns from squares to logarithms, in units of χ² of four degrees of freedom (Cauchy).
pub(super) const SOFT: f64 = 8.0;
/// A landmark beyond this χ² does not agree: four degrees of freedom, 1 in 1000.
pub(super) const MOST: f64 = 18.5;
const STEPS: usize = 15;

/// The most likely pose near `start`: least Σ ρ(rᵀ S⁻¹ r), r the four pixel residuals of a landmark,
/// S = noise + J Σ Jᵀ with the landmark's own covariance, ρ Cauchy's loss. `None` where the landmarks do not say.
pub(super) fn refine(rig: &StereoRig, found: &[Found], start: &Transform<World, Camera>) -> Option<Pose> {
    let mut pose = *start;
    let mut weights: Vec<Option<Matrix4<f64>>> = Vec::new();
    for step in 0..STEPS {
        if step < 2 {
            weights = found.iter().map(|one| weight(rig, one, &pose)).collect();
        }
        let (normal, gradient) = linearize(rig, found, &weights, &pose);
        let xi: Vector6<f64> = normal.cholesky()?.solve(&gradient);
        pose = pose.perturbed(&xi).renormalized();
        // A thousandth of a standard deviation.
        if step >= 2 && gradient.dot(&xi) < 1e-6 {
            break;
        }
    }
    let (normal, _) = linearize(rig, found, &weights, &pose);
    let covariance = normal.cholesky()?.inverse();
    let agrees = found
        .iter()
        .zip(&weights)
        .map(|(one, weight)| {
            let chi = weight.and_then(|weight| residual(rig, one, &pose).map(|r| r.dot(&(weight * r))));
            chi.is_some_and(|chi| chi < MOST)
        })
        .collect();
    (pose.is_finite()).then_some(Pose { world_from_camera: pose, covariance, agrees })
}

fn residual(rig: &StereoRig, one: &Found, pose: &Transform<World, Camera>) -> Option<Vector4<f64>> {
    let here_from_anchor = pose.inverse() * one.world_from_anchor;
    Some(one.pixels - project(rig, &here_from_anchor, &one.at)?.pixels)
}

fn weight(rig: &StereoRig, one: &Found, pose: &Transform<World, Camera>) -> Option<Matrix4<f64>> {
    let here_from_anchor = pose.inverse() * one.world_from_anchor;
    let by = project(rig, &here_from_anchor, &one.at)?.by_landmark(&here_from_anchor);
    let spread: Matrix4<f64> = one.noise + by * one.covariance * by.transpose();
    spread.cholesky().map(|factor| factor.inverse())
}

fn linearize(
    rig: &StereoRig,
    found: &[Found],
    weights: &[Option<Matrix4<f64>>],
    pose: &Transform<World, Camera>,
) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut normal, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
    let camera_from_world = pose.inverse();
    for (one, weight) in found.iter().zip(weights) {
        let Some(weight) = weight else { continue };
        let here_from_anchor = camera_from_world * one.world_from_anchor;
        let Some(seen) = project(rig, &here_from_anchor, &one.at) else { continue };
        let r = one.pixels - seen.pixels;
        let chi = r.dot(&(weight * r));
        let by = seen.by_pose();
        let weighted = weight * by * (1.0 / (1.0 + chi / SOFT));
        normal += by.transpose() * weighted;
        gradient += weighted.transpose() * r;
    }
    (normal, gradient)
}
