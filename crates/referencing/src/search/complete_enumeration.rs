//! Complete enumeration: the paper's search without gates.

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    association::by_coordinates,
    grow::{feasible, max_possible},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED, bounded},
    structural_coherence::{Enumeration, Samples},
};
use crate::problem::Problem;

/// The baseline without gates (the paper's ref. 35): every cloud point is a candidate of every model point.
///
/// Each sample of q model points has M^q choices, whatever the prior. Pairs given without a prior are taken as they
/// are. Longest samples first; the first coherent one is the answer, as in `structural-coherence`.
///
/// Exact within the budget; Σ_q C(n, q) M^q choices, q! times as many with the paper's ordered samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct CompleteEnumeration {
    /// Kind of samples.
    pub(crate) samples: Samples,
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Maximum number of pair tests.
    pub(crate) budget: u64,
    /// Maximum number of pairs of a model and a cloud point; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for CompleteEnumeration {
    fn default() -> Self {
        Self { samples: Samples::Combinations, orientation: true, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for CompleteEnumeration {
    const NAME: &'static str = "complete-enumeration";
    const SUMMARY: &'static str = "all cloud points for all model points, longest samples first, without gates";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, ref. 35";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of model points in the first coherent sample, longest samples first, every cloud point for every model point",
        ),
        ("exact", "within its budget"),
        ("time", "Σ_q C(n, q) M^q choices of n model points and M cloud points; q! times as many with ordered samples"),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for CompleteEnumeration {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        // Candidates given without a prior are no gates: they state the possible pairs.
        if problem.prior.is_none() {
            let points = by_coordinates(problem.model.iter().map(|point| point.at));
            let at = |list: &[usize]| -> Vec<usize> {
                by_coordinates(list.iter().map(|&j| problem.cloud[j].position.at))
                    .into_iter()
                    .map(|k| list[k])
                    .collect()
            };
            feasible(problem, self.max_pairs)?;
            let lists: Vec<(usize, Vec<usize>)> = points
                .into_iter()
                .map(|i| (i, at(&problem.candidates.lists[i])))
                .filter(|(_, list)| !list.is_empty())
                .collect();
            let lists = lists.iter().map(|(i, list)| (*i, list.as_slice())).collect();
            let longest = max_possible(problem);
            return Enumeration::of(problem, lists, self.samples, self.orientation, self.budget).run(longest);
        }
        let (points, cloud) = (problem.model.len(), problem.cloud.len());
        let with_candidates = if cloud > 0 { points } else { 0 };
        if with_candidates < NEEDED {
            return Err(Rejected::TooFew { with_candidates, needed: NEEDED });
        }
        let size = points.saturating_mul(cloud);
        if size > self.max_pairs {
            let (max, bound) = (self.max_pairs, points.min(cloud));
            return Err(Rejected::TooLarge { size, what: "candidate pairs", max, bound });
        }
        let all = by_coordinates(problem.cloud.iter().map(|point| point.position.at));
        let points = by_coordinates(problem.model.iter().map(|point| point.at));
        let lists = points.into_iter().map(|i| (i, all.as_slice())).collect();
        Enumeration::of(problem, lists, self.samples, self.orientation, self.budget).run(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(CompleteEnumeration::default().check(), Ok(()));
        assert!(CompleteEnumeration { budget: 0, ..CompleteEnumeration::default() }.check().is_err());
        assert!(CompleteEnumeration { max_pairs: 2, ..CompleteEnumeration::default() }.check().is_err());
    }
}
