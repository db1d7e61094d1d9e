//! Generalised iterative closest points, from the prior.

use nalgebra::Matrix3;
use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    closest::Closest,
    grow::{conclude_within, feasible},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, bounded},
    pose::refined,
};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::{mahalanobis::Mahalanobis, solver::Solver},
};

/// Generalised ICP (Segal, Haehnel and Thrun 2009) with point covariances.
///
/// Alternately minimises Σ rᵀ S⁻¹ r over the pose and over the nearest candidate of each model point, from the prior
/// on; r is the residual of a pair and S = Σ_measured + σ_model² I. Depth, which stereo measures worst, therefore
/// counts least. The covariances are those of the points, not of local surfaces, since features have none.
///
/// Not exact: it ends in the minimum next to the prior. N distances an iteration for N candidate pairs, and a weighted
/// fit. Needs a prior, and positive definite covariances: a point without one is no candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Gicp {
    /// Whether mirror images are rejected; `false` relies on the pose alone.
    pub(crate) orientation: bool,
    /// Fraction of the nearest pairs that is fitted, above 0 and at most 1: points out of view have no true pair.
    pub(crate) keep: f64,
    /// Maximum number of iterations.
    pub(crate) iterations: usize,
    /// Maximum number of distances.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for Gicp {
    fn default() -> Self {
        Self { orientation: true, keep: 0.6, iterations: 50, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for Gicp {
    const NAME: &'static str = "gicp";
    const SUMMARY: &'static str = "as icp, with distances and fit weighted by the covariances";
    const SOURCE: &'static str = "Segal, Haehnel, Thrun, Generalized-ICP, 2009";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "nothing over all poses: it minimises Σ rᵀ S⁻¹ r of nearest candidates, from the prior on"),
        ("exact", "no: it ends in the minimum next to the prior"),
        ("time", "N distances an iteration for N candidate pairs"),
    ];

    fn check(&self) -> Result<(), String> {
        // The comparison rejects NaN too.
        let fraction = self.keep > 0.0 && self.keep <= 1.0;
        in_range(fraction, "keep", self.keep, "a fraction above 0, at most 1")?;
        in_range(self.iterations > 0, "iterations", self.iterations, "1 or more")?;
        bounded(self.budget, self.max_pairs)
    }
}

/// Minimum standard deviation of a measurement (m).
const FLOOR: f64 = 1e-6;

impl Search for Gicp {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let prior = problem.prior.ok_or(Rejected::NoPrior)?;
        let &Self { keep, iterations, budget, .. } = self;
        let distance = |pose: &Transform<Object, Camera>, pair: Correspondence| {
            let (known, seen) = (&problem.model[pair.model], &problem.cloud[pair.cloud].position);
            let noise = seen.covariance + Matrix3::identity() * (known.sigma * known.sigma + FLOOR * FLOOR);
            let off = pose.inverse() * known.at - seen.at;
            noise.cholesky().map_or(f64::NAN, |s| off.dot(&s.solve(&off)).sqrt())
        };
        let solver = Mahalanobis::default();
        let fit =
            |pairs: &[Correspondence]| solver.solve(&Observations::of(pairs, problem.model, problem.cloud, None)).ok();
        let (pose, vertices, mut pair_tests, ended) =
            Closest { distance, fit, keep, iterations, budget }.run(problem, prior.object_from_camera);
        let ended = ended.then_some((budget, pair_tests));
        let (_, ranked) = refined(problem, &vertices, pose, &mut pair_tests);
        conclude_within(problem, &ranked, self.orientation, pair_tests, ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Gicp::default().check(), Ok(()));
        assert!(Gicp { keep: 0.0, ..Gicp::default() }.check().is_err());
        assert!(Gicp { keep: f64::NAN, ..Gicp::default() }.check().is_err());
        assert!(Gicp { iterations: 0, ..Gicp::default() }.check().is_err());
    }
}
