//! Mahalanobis: 3D–3D least squares, every point weighed by its whole covariance.

use nalgebra::Matrix3;
use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Point, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    descent::{Term, linearize, minimize},
    kabsch,
    spread::{check, in_front},
    starts::likeliest,
};
use crate::{Observation, Observations};

/// The pose of least Σ rᵀ (Σ_measured + σ_model² I)⁻¹ r, r = C − H⁻¹P in camera axes.
///
/// A triangulated point's covariance grows with the fourth power of its depth, so that points which noise
/// brought nearer are believed too much; and noise of the disparity moves the mean depth outwards,
/// E z ≈ z (1 + σ_d²/d²). Where pixels and rig are known, both are therefore seen from the *fitted* point p: its
/// covariance Σ(p) = (Jᵀ Σ_px⁻¹ J)⁻¹, J = ∂pixels/∂p, and the displacement C − p as the step that moves p's pixels to
/// those of C to first order, r = Σ(p) Jᵀ Σ_px⁻¹ (π(C) − π(p)). Pixels have no bias, so r has none to second
/// order. The answer then solves Σ ∂pᵀ (Σ(p) + σ² I)⁻¹ r = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mahalanobis {
    /// Second extent of the points over the first below which they count as a line.
    pub least_ratio: f64,
    /// Whether covariances and displacements are seen from the fitted points, where pixels and rig are known.
    pub refit: bool,
    /// How many starts at most, where pixels and rig are known: one is the unweighted fit alone.
    pub starts: usize,
}

impl Default for Mahalanobis {
    fn default() -> Self {
        Self { least_ratio: 1e-3, refit: true, starts: 5 }
    }
}

impl Component for Mahalanobis {
    const NAME: &'static str = "mahalanobis";
    const SUMMARY: &'static str = "3D-3D least squares with full covariances, seen from the fitted points";
    const SOURCE: &'static str =
        "Matei, Meer, Optimal rigid motion estimation and performance evaluation with bootstrap, 1999";

    fn check(&self) -> Result<(), String> {
        in_range((1..=5).contains(&self.starts), "starts", self.starts, "1 to 5")?;
        // Written so that a NaN is refused too.
        let share = self.least_ratio >= 0.0 && self.least_ratio < 1.0;
        in_range(share, "least-ratio", self.least_ratio, "a share from 0 to below 1")
    }
}

impl Solver for Mahalanobis {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let Some(rig) = self.rig(data) else {
            let start = kabsch::fit(&data.points);
            return minimize(&data.points, &start, &as_measured).ok_or(Degenerate::NotFinite);
        };
        in_front(data)?;
        let fine = |point: &_, at: &_| as_fitted(rig, point, at);
        likeliest(data, rig, self.starts, &as_measured, &fine).ok_or(Degenerate::Singular)
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let information = match self.rig(data) {
            Some(rig) => linearize(&data.points, at, &|point, at| as_fitted(rig, point, at)),
            None => linearize(&data.points, at, &as_measured),
        };
        information.and_then(|all| all.covariance()).map(Covariance6::new).ok_or(Degenerate::Singular)
    }
}

impl Mahalanobis {
    fn rig<'a>(&self, data: &Observations<'a>) -> Option<&'a StereoRig> {
        data.rig.filter(|_| self.refit && data.points.iter().any(|point| point.pixels.is_some()))
    }
}

/// Coordinates are never better than this (m): exact data would otherwise have infinite weight.
const FLOOR: f64 = 1e-9;

/// A point with the covariance it was measured with.
pub(super) fn as_measured(point: &Observation, at: &Point<Camera>) -> Option<Term> {
    let noise = point.noise() + Matrix3::identity() * (FLOOR * FLOOR);
    let information = noise.try_inverse().unwrap_or_else(|| Matrix3::identity() / (noise.trace() / 3.0));
    Some(Term::of(information, &(point.measured.at - *at)))
}

/// A point with covariance and displacement as seen from where it was fitted.
fn as_fitted(rig: &StereoRig, point: &Observation, at: &Point<Camera>) -> Option<Term> {
    let Some(pixels) = &point.pixels else { return as_measured(point, at) };
    let (expected, j) = rig.project_with_jacobian(at)?;
    let moved = rig.project(&point.measured.at)?.coordinates() - expected.coordinates();
    let weighted = pixels.covariance.try_inverse()? * j;
    let (information, pull) = (j.transpose() * weighted, weighted.transpose() * moved);
    let covariance = information.try_inverse()?;
    let residual = covariance * pull;
    let model = point.model_sigma * point.model_sigma;
    if model > 0.0 {
        return Some(Term::of((covariance + Matrix3::identity() * model).try_inverse()?, &residual));
    }
    Some(Term { information, pull, cost: residual.dot(&pull) })
}
