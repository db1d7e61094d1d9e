//! Iterative closest points, from the prior.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    closest::Closest,
    grow::{conclude_within, feasible},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, bounded},
    pose::{fitted, refined},
};
use crate::problem::{Correspondence, Problem};

/// Trimmed ICP (Besl and McKay 1992, Chetverikov et al. 2002).
///
/// Alternately minimises Σ |H c − p|² over the pose H and over the nearest candidate c of each model point p: the
/// nearest `keep` of all pairs are fitted, from the prior on, until they no longer change. The answer is the set that
/// the last pose explains.
///
/// Not exact: it ends in the minimum next to the prior, and clutter in the gates holds it back. N distances an
/// iteration for N candidate pairs. Needs a prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Icp {
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

impl Default for Icp {
    fn default() -> Self {
        Self { orientation: true, keep: 0.6, iterations: 50, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for Icp {
    const NAME: &'static str = "icp";
    const SUMMARY: &'static str = "nearest candidates and their least-squares pose in turn, from the prior";
    const SOURCE: &'static str = "Besl, McKay, A method for registration of 3-D shapes, 1992; the fraction kept: \
                                  Chetverikov et al., The trimmed iterative closest point algorithm, 2002";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "nothing over all poses: it minimises Σ r² of nearest candidates, from the prior on"),
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

impl Search for Icp {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let prior = problem.prior.ok_or(Rejected::NoPrior)?;
        let &Self { keep, iterations, budget, .. } = self;
        let distance = |pose: &Transform<Object, Camera>, pair: Correspondence| {
            (*pose * problem.cloud[pair.cloud].position.at).distance(&problem.model[pair.model].at)
        };
        let fit = |pairs: &[Correspondence]| fitted(problem, pairs);
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
        assert_eq!(Icp::default().check(), Ok(()));
        assert!(Icp { keep: 0.0, ..Icp::default() }.check().is_err());
        assert!(Icp { keep: f64::NAN, ..Icp::default() }.check().is_err());
        assert!(Icp { iterations: 0, ..Icp::default() }.check().is_err());
    }
}
