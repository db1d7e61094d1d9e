//! Iteratively reweighted least squares: robust losses that grow more slowly than the square.

use nalgebra::Vector6;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::{Observation, Observations},
    solve::{
        closed_form::{distance, fit_weighted, variance},
        covariance::{
            resampled::{self, Answer},
            sandwich,
        },
        degeneracy::{Degenerate, check, converged, fraction},
        likelihood::normal::singular,
        solver::Solver,
    },
};

/// The loss of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Loss {
    /// d² up to the threshold, linear beyond (Huber, 1964).
    #[default]
    Huber,
    /// c² ln(1 + d²/c²): the loss suppresses large residuals.
    Cauchy,
    /// ‖C·H − P‖, the paper's sum as printed; the threshold is unused.
    UnSquared,
}

/// Robust least squares: min Σ ρ(d_k), by iterated weighted fits with the weights w = ρ'(d)/2d of the last residuals.
///
/// For Huber and Cauchy d_k = ‖C·H − P‖ / σ_k with σ_k² = tr(Σ_k + σ_model² I)/3, and the sum is Σ σ_k² ρ(d_k). If
/// every residual is within Huber's threshold, the answer is that of `kabsch`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Irls {
    /// Loss of a residual; Huber's, the default, keeps every identified point in the fit.
    pub(crate) loss: Loss,
    /// Threshold (standard deviations of a point), positive: the start of Huber's linear part, or Cauchy's c.
    pub(crate) threshold: f64,
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

impl Default for Irls {
    fn default() -> Self {
        Self { loss: Loss::Huber, threshold: 3.0, min_ratio: 1e-3 }
    }
}

impl Component for Irls {
    const NAME: &'static str = "irls";
    const SUMMARY: &'static str = "robust least squares: Huber, Cauchy, or the un-squared sum of Bobkov et al. 2021";
    const SOURCE: &'static str = "Holland, Welsch, Robust regression using iteratively reweighted least-squares, 1977";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        // A NaN is rejected as well.
        let positive = self.threshold > 0.0 && self.threshold.is_finite();
        in_range(positive, "threshold", self.threshold, "a positive number of standard deviations")?;
        fraction("min-ratio", self.min_ratio)
    }
}

/// Maximum number of steps.
const MAX_STEPS: u64 = 200;
/// Step (standard deviations of the pose) at which an iteration for a covariance ends; the remaining error adds 1e-4 to
/// the variance.
const STILL: f64 = 1e-3;
/// Lower bound of a residual (standard deviations of the point); the un-squared sum is not differentiable at zero.
const CORNER: f64 = 1e-4;

impl Solver for Irls {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        self.follow(data, |step| step.amax() <= 1e-14)
    }

    /// The covariance by resampling: for residuals near a bend of the loss, the derivative at one draw is not
    /// representative.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let known = sandwich::covariance(data, at, |k| self.weight(&data.points[k], at))?;
        let length = known.matrix.cholesky().ok_or_else(|| singular(&known.matrix))?;
        let still = |step: &Vector6<f64>| step.dot(&length.solve(step)) <= STILL * STILL;
        resampled::covariance(|sampled| self.follow(sampled, still), data, at, self.bends())
    }
}

impl Irls {
    /// The iteration from Kabsch's pose, until a step is `still`.
    fn follow(
        &self,
        data: &Observations<'_>,
        still: impl Fn(&Vector6<f64>) -> bool,
    ) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        let mut pose = fit_weighted(&data.points, |_| 1.0);
        let mut last = f64::INFINITY;
        for taken in 1..=MAX_STEPS {
            let next = fit_weighted(&data.points, |k| self.weight(&data.points[k], &pose));
            let step = pose.error_to(&next);
            if still(&step) {
                return Ok(next);
            }
            if taken == MAX_STEPS {
                // Steps shrink by a constant factor or more slowly: the sum of the remaining steps.
                let known = sandwich::covariance(data, &next, |k| self.weight(&data.points[k], &next))?;
                let length = known.matrix.cholesky().map_or(f64::INFINITY, |c| step.dot(&c.solve(&step)).sqrt());
                let shrink = step.norm() / last;
                let off = if shrink < 1.0 { length * shrink / (1.0 - shrink) } else { length * MAX_STEPS as f64 };
                return converged(taken, off).map(|()| next);
            }
            (pose, last) = (next, step.norm());
        }
        Ok(pose)
    }

    /// Noise rarely reaches the bend of Huber's loss; the other losses are nonlinear everywhere.
    fn bends(&self) -> Answer {
        match self.loss {
            Loss::Huber => Answer::Straight,
            Loss::Cauchy | Loss::UnSquared => Answer::Bent,
        }
    }

    fn weight(&self, point: &Observation, pose: &Transform<Object, Camera>) -> f64 {
        match self.loss {
            Loss::Huber => (self.threshold / distance(point, pose)).min(1.0),
            Loss::Cauchy => 1.0 / (1.0 + (distance(point, pose) / self.threshold).powi(2)),
            Loss::UnSquared => 1.0 / point.residual(pose).norm().max(CORNER * variance(point).sqrt()),
        }
    }
}
