//! Weighted Kabsch: least squares with one scalar weight per point.

use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        closed_form::{fit_weighted, variance},
        covariance::sandwich,
        degeneracy::{Degenerate, check, fraction},
        solver::Solver,
    },
};

/// Kabsch's least squares with weights: min Σ w_k ‖P_k − C_k H‖², w_k = 3 / tr(Σ_k + σ_model² I).
///
/// Near points have more weight than far ones. A scalar weight cannot express that a far point is precise across the
/// line of sight; `mahalanobis` uses the full covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct WeightedKabsch {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

impl Default for WeightedKabsch {
    fn default() -> Self {
        Self { min_ratio: 1e-3 }
    }
}

impl Component for WeightedKabsch {
    const NAME: &'static str = "weighted-kabsch";
    const SUMMARY: &'static str = "least squares over rigid motions, one weight per point from its variance";
    const SOURCE: &'static str = "Kabsch, A solution for the best rotation to relate two sets of vectors, 1976; \
                                  Sorkine-Hornung, Rabinovich, Least-squares rigid motion using SVD, 2017";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for WeightedKabsch {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        Ok(fit_weighted(&data.points, |k| 1.0 / variance(&data.points[k])))
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let weight = |k: usize| 1.0 / variance(&data.points[k]);
        sandwich::or_resampled(data, at, weight, |sampled| self.solve(sampled))
    }
}
