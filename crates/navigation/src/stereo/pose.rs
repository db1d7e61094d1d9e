//! The pose of a pair from the landmarks found in it.

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, StereoRig, Transform, World};

use super::landmark::project;

/// A landmark found in a new pair.
pub(crate) struct Found {
    /// The pose of its key frame.
    pub(crate) world_from_anchor: Transform<World, Camera>,
    /// (x, y, w) there.
    pub(crate) at: Vector3<f64>,
    /// Their covariance.
    pub(crate) covariance: Matrix3<f64>,
    /// Where the new images show it.
    pub(crate) pixels: Vector4<f64>,
    /// The covariance of that (px²).
    pub(crate) noise: Matrix4<f64>,
}

/// A pose and what agrees with it.
pub(crate) struct Pose {
    pub(crate) world_from_camera: Transform<World, Camera>,
    /// Of ξ in `world_from_camera · Exp(ξ)`, the landmarks' key frames taken as exact.
    pub(crate) covariance: Matrix6<f64>,
    /// Whether each landmark agrees.
    pub(crate) agrees: Vec<bool>,
}

/// Where the loss turns from squares to logarithms, in units of χ² of four degrees of freedom (Cauchy).
pub(super) const SOFT: f64 = 8.0;
/// A landmark beyond this χ² does not agree: four degrees of freedom, 1 in 1000.
pub(super) const MAX: f64 = 18.5;
const STEPS: usize = 15;

/// The most likely pose near `start`: least Σ ρ(rᵀ S⁻¹ r), r the four pixel residuals of a landmark,
/// S = noise + J Σ Jᵀ with the landmark's own covariance, ρ Cauchy's loss. `None` where the landmarks do not say.
pub(crate) fn refine(rig: &StereoRig, found: &[Found], start: &Transform<World, Camera>) -> Option<Pose> {
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
            chi.is_some_and(|chi| chi < MAX)
        })
        .collect();
    (pose.is_finite()).then_some(Pose { world_from_camera: pose, covariance, agrees })
}

/// The most likely pose and landmarks together, for what is known to agree: the least
/// Σ (rᵀ noise⁻¹ r + (p − at)ᵀ Σ⁻¹ (p − at)) over the pose and the places p, ρ the identity.
///
/// A derivative at the place `at` as it was measured shares its error with the residual; over a hundred landmarks of one
/// look that is a bias as large as the noise. Here derivatives are those at the fitted places.
pub(crate) fn joint(rig: &StereoRig, found: &[Found], start: &Transform<World, Camera>) -> Option<Pose> {
    let mut pose = *start;
    let mut places: Vec<Vector3<f64>> = found.iter().map(|one| one.at).collect();
    let mut agrees = vec![false; found.len()];
    for step in 0..STEPS {
        let (mut normal, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        let camera_from_world = pose.inverse();
        let mut terms = Vec::with_capacity(found.len());
        for (one, place) in found.iter().zip(&places) {
            let here_from_anchor = camera_from_world * one.world_from_anchor;
            let seen = project(rig, &here_from_anchor, place)?;
            let by = seen.by_landmark(&here_from_anchor);
            let spread: Matrix4<f64> = one.noise + by * one.covariance * by.transpose();
            let weight = spread.cholesky()?.inverse();
            let r = one.pixels - seen.pixels - by * (one.at - place);
            let by_pose = seen.by_pose();
            normal += by_pose.transpose() * weight * by_pose;
            gradient += by_pose.transpose() * (weight * r);
            terms.push((by, weight, r, by_pose));
        }
        let factor = normal.cholesky()?;
        let xi: Vector6<f64> = factor.solve(&gradient);
        pose = pose.perturbed(&xi).renormalized();
        for (index, (by, weight, r, by_pose)) in terms.into_iter().enumerate() {
            let rest = r - by_pose * xi;
            let weighted = weight * rest;
            places[index] = found[index].at + found[index].covariance * (by.transpose() * weighted);
            agrees[index] = rest.dot(&weighted) < MAX;
        }
        // A thousandth of a standard deviation.
        if step >= 2 && gradient.dot(&xi) < 1e-6 {
            let covariance = factor.inverse();
            return pose.is_finite().then_some(Pose { world_from_camera: pose, covariance, agrees });
        }
    }
    None
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
