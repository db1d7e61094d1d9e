//! The pose of a pair from its landmarks.

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, StereoRig, Transform, World};

use super::landmark::project;

/// The observation of a landmark in a new pair.
pub(crate) struct Found {
    /// The pose of its anchor key frame.
    pub(crate) world_from_anchor: Transform<World, Camera>,
    /// Its parameters (x, y, w) in the anchor's frame.
    pub(crate) at: Vector3<f64>,
    /// Their covariance.
    pub(crate) covariance: Matrix3<f64>,
    /// The pixel coordinates in the new images.
    pub(crate) pixels: Vector4<f64>,
    /// The covariance of the pixel coordinates (px²).
    pub(crate) noise: Matrix4<f64>,
}

/// An estimated pose and its inliers.
pub(crate) struct Pose {
    pub(crate) world_from_camera: Transform<World, Camera>,
    /// The covariance of ξ in `world_from_camera · Exp(ξ)`, given the poses of the anchors.
    pub(crate) covariance: Matrix6<f64>,
    /// Whether each landmark agrees with the pose.
    pub(crate) agrees: Vec<bool>,
}

/// Scale of the Cauchy loss, in units of χ² with four degrees of freedom.
pub(super) const SOFT: f64 = 8.0;
/// Inlier threshold of a landmark: χ² with four degrees of freedom at a probability of 0.001.
pub(super) const MAX: f64 = 18.5;
const STEPS: usize = 15;

/// The robust maximum-likelihood pose near `start`.
///
/// It minimises Σ ρ(rᵀ S⁻¹ r) with the four pixel residuals r of a landmark, S = noise + J Σ Jᵀ including the
/// landmark's own covariance, and the Cauchy loss ρ. `None` if the landmarks do not determine the pose.
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
        // Convergence: a step below a thousandth of a standard deviation.
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

/// The maximum-likelihood pose and landmarks together, for landmarks known to be inliers.
///
/// It minimises Σ (rᵀ noise⁻¹ r + (p − at)ᵀ Σ⁻¹ (p − at)) over the pose and the landmark parameters p.
///
/// A derivative evaluated at the measured parameters `at` shares their error with the residual; with a hundred
/// landmarks of a single key frame this causes a bias as large as the noise. Here derivatives are evaluated at the
/// fitted parameters.
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
        // Convergence: a step below a thousandth of a standard deviation.
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
