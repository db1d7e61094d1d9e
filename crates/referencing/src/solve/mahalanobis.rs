//! Mahalanobis: 3D–3D least squares, every point weighed by its whole covariance.

use nalgebra::{Matrix3, SMatrix, Vector3};
use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

use super::{
    Degenerate, Rival, Solver,
    descent::{Term, linearize, minimize, model_errors},
    kabsch,
    profile::widened,
    sightings::{FEW, Sightings, Target},
    spread::{check, share},
    starts::{likeliest, rivals},
};
use crate::{Observation, Observations};

/// The pose of least Σ rᵀ (Σ_measured + σ_model² I)⁻¹ r, r = C − H⁻¹P in camera axes.
///
/// A triangulated point's covariance grows with the fourth power of its depth, so that points which noise
/// brought nearer are believed too much; and noise of the disparity moves the mean depth outwards,
/// E z ≈ z (1 + σ_d²/d²). Where pixels and rig are known, both are therefore seen from the *fitted* point p: its
/// covariance Σ(p) = (Jᵀ Σ_px⁻¹ J)⁻¹, J = ∂pixels/∂p, and the displacement C − p as the step that moves p's pixels to
/// those of C to first order, r = Σ(p) Jᵀ Σ_px⁻¹ (π(C) − π(p)). Pixels have no bias, so r has none to second
/// order. The answer then solves Σ ∂pᵀ (Σ(p) + σ² I)⁻¹ r = 0: it is that of the pixels of the triangulated point.
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
        share("least-ratio", self.least_ratio)
    }
}

impl Solver for Mahalanobis {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        self.solved(data, |pose, _| Ok(*pose))
    }

    fn rivals(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, most: f64) -> Vec<Rival> {
        let Some(rig) = self.rig(data) else { return Vec::new() };
        let mut sightings = Sightings::new(rig);
        match sightings.see(&data.points, Target::Triangulated) {
            Ok(()) => rivals(data, rig, self.starts, &sightings, at, most),
            Err(_) => Vec::new(),
        }
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let Some(rig) = self.rig(data) else {
            let measured = Measured::of(&data.points);
            return covariance(data, at, &|k, place| Some(measured.term(k, place)));
        };
        let mut all = Sightings::new(rig);
        all.see(&data.points, Target::Triangulated)?;
        let live = |k: usize, place: &_| all.live(k, place);
        let first = covariance(data, at, &live)?;
        Ok(Covariance6::new(widened(&data.points, at, first.matrix, &live)))
    }

    fn model_errors(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        let Some(rig) = self.rig(data) else {
            let measured = Measured::of(&data.points);
            return model_errors(&data.points, at, &|k, place: &_| Some(measured.term(k, place)));
        };
        let mut all = Sightings::new(rig);
        all.see(&data.points, Target::Triangulated)?;
        model_errors(&data.points, at, &|k, place: &_| all.live(k, place))
    }
}

/// What a point, by its number, says of the place where a pose puts it.
pub(super) type Terms<'a> = &'a dyn Fn(usize, &Vector3<f64>) -> Option<Term>;

/// The inverse of the points' information at a pose.
pub(super) fn covariance(
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
    terms: Terms<'_>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    linearize(&data.points, at, &terms)?.covariance().map(Covariance6::new)
}

impl Mahalanobis {
    /// What `work` makes of the answer and of the terms that led to it.
    pub(super) fn solved<R>(
        &self,
        data: &Observations<'_>,
        work: impl FnOnce(&Transform<Object, Camera>, Terms<'_>) -> Result<R, Degenerate>,
    ) -> Result<R, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let Some(rig) = self.rig(data) else {
            let (start, measured) = (kabsch::fit(&data.points), Measured::of(&data.points));
            let term = |k: usize, at: &_| Some(measured.term(k, at));
            return work(&minimize(&data.points, &start, &term)?, &term);
        };
        let mut sightings = Sightings::new(rig);
        sightings.see(&data.points, Target::Triangulated)?;
        work(&likeliest(data, rig, self.starts, &sightings)?, &|k, place| sightings.live(k, place))
    }

    fn rig<'a>(&self, data: &Observations<'a>) -> Option<&'a StereoRig> {
        data.rig.filter(|_| self.refit && data.points.iter().any(|point| point.pixels.is_some()))
    }
}

/// Points with the covariance they were measured with.
pub(super) struct Measured<'a> {
    points: &'a [Observation],
    information: SmallVec<[Matrix3<f64>; FEW]>,
}

impl<'a> Measured<'a> {
    pub(super) fn of(points: &'a [Observation]) -> Self {
        Self { points, information: points.iter().map(information).collect() }
    }

    /// What the k-th says of the place where a pose puts it.
    #[inline]
    pub(super) fn term(&self, k: usize, at: &Vector3<f64>) -> Term {
        Term::of(self.information[k], &(self.points[k].measured.at.coords - at))
    }
}

/// (Σ_measured + σ_model² I)⁻¹.
pub(super) fn information(point: &Observation) -> Matrix3<f64> {
    let noise = point.noise();
    // In units of its own size, so that no determinant leaves the range of numbers.
    let size = noise.trace() / 3.0;
    (noise / size).try_inverse().unwrap_or_else(Matrix3::identity) / size
}
