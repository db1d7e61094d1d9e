//! Stereo reprojection: maximum likelihood on the four pixel coordinates of every point.

use nalgebra::{Matrix4, Vector4};
use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Point, StereoRig, Transform, UncertainPixels};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    descent::{Term, linearize},
    spread::{check, in_front},
    starts::likeliest,
};
use crate::{Observation, Observations};

/// The most likely pose given where both images show the points: least Σ rᵀ S⁻¹ r over SE(3), r the four pixel
/// residuals of a point and S = Σ_px + σ_model² J Jᵀ, J = ∂pixels/∂p at the fitted point (the error of the model's
/// point marginalised). It reaches the Cramér–Rao bound; its covariance (Σ Jᵀ S⁻¹ J)⁻¹ is that bound at the answer.
///
/// Three or four points, or a small object far away, leave several minima. Where the answer from the unweighted
/// fit of the triangulated points is in doubt, the poses that three points allow the left camera alone (P3P) are
/// tried as well, and the least cost stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StereoReprojection {
    /// How many starts at most: one is the unweighted fit alone.
    pub starts: usize,
    /// Second extent of the points over the first below which they count as a line.
    pub least_ratio: f64,
}

impl Default for StereoReprojection {
    fn default() -> Self {
        Self { starts: 5, least_ratio: 1e-3 }
    }
}

impl Component for StereoReprojection {
    const NAME: &'static str = "stereo-reprojection";
    const SUMMARY: &'static str = "maximum likelihood on the pixels of both images, from several starts";
    const SOURCE: &'static str =
        "Hartley, Zisserman, Multiple View Geometry, 2003; Persson, Nordberg, Lambda Twist, 2018";

    fn check(&self) -> Result<(), String> {
        in_range((1..=5).contains(&self.starts), "starts", self.starts, "1 to 5")?;
        // Written so that a NaN is refused too.
        let share = self.least_ratio >= 0.0 && self.least_ratio < 1.0;
        in_range(share, "least-ratio", self.least_ratio, "a share from 0 to below 1")
    }
}

impl Solver for StereoReprojection {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let rig = pixels_and_rig(data)?;
        in_front(data)?;
        let (coarse, fine) = (|point: &_, at: &_| coarse(rig, point, at), |point: &_, at: &_| term(rig, point, at));
        likeliest(data, rig, self.starts, &coarse, &fine).ok_or(Degenerate::Singular)
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let rig = pixels_and_rig(data)?;
        let all = linearize(&data.points, at, &|point, at| term(rig, point, at));
        all.and_then(|all| all.covariance()).map(Covariance6::new).ok_or(Degenerate::Singular)
    }
}

/// The rig, if it and every point's pixels are known.
pub(super) fn pixels_and_rig<'a>(data: &Observations<'a>) -> Result<&'a StereoRig, Degenerate> {
    data.rig.filter(|_| data.points.iter().all(|point| point.pixels.is_some())).ok_or(Degenerate::NoPixels)
}

/// Pixels are never better known than this: exact ones would otherwise have infinite weight.
const FLOOR: f64 = 1e-6;

/// What a point says, S taken at the fitted point.
pub(super) fn term(rig: &StereoRig, point: &Observation, at: &Point<Camera>) -> Option<Term> {
    weighed(rig, point, at, at)
}

/// The same with S at the measured point, which does not depend on the pose: costs can be compared.
fn coarse(rig: &StereoRig, point: &Observation, at: &Point<Camera>) -> Option<Term> {
    weighed(rig, point, at, &point.measured.at)
}

fn weighed(rig: &StereoRig, point: &Observation, at: &Point<Camera>, weigh_at: &Point<Camera>) -> Option<Term> {
    let pixels: &UncertainPixels = point.pixels.as_ref()?;
    let (expected, j) = rig.project_with_jacobian(at)?;
    let r: Vector4<f64> = pixels.at.coordinates() - expected.coordinates();
    let mut s = pixels.covariance + Matrix4::identity() * (FLOOR * FLOOR);
    if point.model_sigma > 0.0 {
        let by_model = if weigh_at == at { j } else { rig.project_with_jacobian(weigh_at)?.1 };
        s += by_model * by_model.transpose() * (point.model_sigma * point.model_sigma);
    }
    let weight = s.try_inverse()?;
    let weighted = weight * j;
    Some(Term { information: j.transpose() * weighted, pull: weighted.transpose() * r, cost: r.dot(&(weight * r)) })
}
