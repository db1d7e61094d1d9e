//! Iteratively reweighted least squares: losses that grow more slowly than the square.

use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    kabsch::fit_weighted,
    spread::{check, share},
    weighted_kabsch::variance,
};
use crate::{Observation, Observations};

/// What a residual costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Loss {
    /// d² up to the threshold, linear beyond (Huber, 1964).
    #[default]
    Huber,
    /// c² ln(1 + d²/c²): far residuals hardly count.
    Cauchy,
    /// ‖C·H − P‖ itself, the paper's sum as printed: the threshold plays no part.
    UnSquared,
}

/// The motion of least Σ ρ(d_k), by weighted least squares with the weights of the last residuals,
/// w = ρ'(d)/2d. For Huber and Cauchy d_k = ‖C·H − P‖ / σ_k, σ_k² = tr(Σ_k + σ_model² I)/3, and the sum is
/// Σ σ_k² ρ(d_k), so that with every residual within Huber's threshold the answer is that of `kabsch`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Irls {
    /// What a residual costs.
    pub(crate) loss: Loss,
    /// Where Huber's loss turns linear, and Cauchy's c (standard deviations of a point).
    pub(crate) threshold: f64,
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) least_ratio: f64,
}

impl Default for Irls {
    fn default() -> Self {
        Self { loss: Loss::Huber, threshold: 3.0, least_ratio: 1e-3 }
    }
}

impl Component for Irls {
    const NAME: &'static str = "irls";
    const SUMMARY: &'static str = "robust least squares: Huber, Cauchy, or the paper's un-squared sum";
    const SOURCE: &'static str = "Holland, Welsch, Robust regression using iteratively reweighted least-squares, 1977";

    fn check(&self) -> Result<(), String> {
        // Written so that a NaN is refused too.
        let positive = self.threshold > 0.0 && self.threshold.is_finite();
        in_range(positive, "threshold", self.threshold, "a positive number of standard deviations")?;
        share("least-ratio", self.least_ratio)
    }
}

/// Steps of the iteration.
const MOST_STEPS: usize = 200;
/// Residuals count as no smaller than this (m): the un-squared sum has a corner at zero.
const CORNER: f64 = 1e-7;

impl Solver for Irls {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let mut pose = fit_weighted(&data.points, |_| 1.0);
        for _ in 0..MOST_STEPS {
            let next = fit_weighted(&data.points, |k| self.weight(&data.points[k], &pose));
            let step = pose.error_to(&next).amax();
            pose = next;
            if step <= 1e-14 {
                break;
            }
        }
        Ok(pose)
    }
}

impl Irls {
    fn weight(&self, point: &Observation, pose: &Transform<Object, Camera>) -> f64 {
        match self.loss {
            Loss::Huber => (self.threshold / distance(point, pose)).min(1.0),
            Loss::Cauchy => 1.0 / (1.0 + (distance(point, pose) / self.threshold).powi(2)),
            Loss::UnSquared => 1.0 / point.residual(pose).norm().max(CORNER),
        }
    }
}

/// The residual in standard deviations of its point, one number for all axes: with the whole covariance the weights
/// would belong to another sum than the one that is solved, and the iteration need not end.
pub(super) fn distance(point: &Observation, pose: &Transform<Object, Camera>) -> f64 {
    point.residual(pose).norm() / variance(point).sqrt()
}
