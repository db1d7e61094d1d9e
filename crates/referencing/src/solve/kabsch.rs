//! Kabsch: unweighted least squares over rigid motions.

use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        closed_form::fit,
        covariance::sandwich,
        degeneracy::{Degenerate, check, fraction},
        solver::Solver,
    },
};

/// Kabsch's least squares over rigid motions: min Σ ‖P_k − C_k H‖², with equal weights.
///
/// It is the paper's "standard method". With a_k = P_k − P̄, b_k = C_k − C̄ and M = Σ a_k b_kᵀ = U S Vᵀ, the rotation
/// is R = U diag(1, 1, det(U Vᵀ)) Vᵀ and the translation P̄ − R C̄. The determinant excludes reflections.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Kabsch {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub min_ratio: f64,
}

impl Default for Kabsch {
    fn default() -> Self {
        Self { min_ratio: 1e-3 }
    }
}

impl Component for Kabsch {
    const NAME: &'static str = "kabsch";
    const SUMMARY: &'static str = "unweighted least squares over rigid motions, by singular values";
    const SOURCE: &'static str = "Kabsch, A solution for the best rotation to relate two sets of vectors, 1976; \
                                  Umeyama, Least-squares estimation of transformation parameters, 1991";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for Kabsch {
    fn least_squares(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        Ok(fit(&data.points))
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        sandwich::or_resampled(data, at, |_| 1.0, |sampled| self.solve(sampled))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Kabsch::default().check(), Ok(()));
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Kabsch { min_ratio: bad }.check().is_err(), "{bad}");
        }
    }
}
