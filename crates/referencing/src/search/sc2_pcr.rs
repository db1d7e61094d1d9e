//! SC²-PCR: seeds with the pairs of highest second-order compatibility.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    affinity::{Affinity, by_weight, normalized},
    alike::slack,
    association::Association,
    bitset::BitMatrix,
    consensus::bits::shared,
    grow::feasible,
    hypotheses::{BestPose, scored},
    identification::{Identification, Rejected, Search},
    limits::NEEDED,
};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::closed_form::fit_weighted,
};

/// SC²-PCR (Chen et al. 2022): registration by second-order spatial compatibility.
///
/// Two pairs are compatible if their distances agree; their second-order compatibility is the number of other pairs
/// with which both are compatible within half of the tolerance Δ. Chance agreements seldom share neighbours.
///
/// Seeds are the pairs of greatest weight in the principal eigenvector of the agreements 1 − (d/Δ)², local maxima
/// within Δ in the model first. Each seed takes the `first` most compatible pairs and keeps the `second` that share
/// most of these with it; the principal eigenvector of their agreements weighs them in a least-squares pose. The pose
/// with most pairs within tolerance is fitted again to all of them.
///
/// Unlike the authors' program, a consensus set is not filled to its size with incompatible pairs, and there are at least
/// three seeds.
///
/// Not exact. After K²/2 pair tests for K candidate pairs, a seed takes as many comparisons of rows as it has
/// compatible pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Sc2Pcr {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Fraction of the pairs that are seeds, above 0 and at most 1.
    pub(crate) seeds: f64,
    /// Number of pairs in the first stage of a consensus set.
    pub(crate) first: usize,
    /// Number of pairs in its second stage, 3 to `first`.
    pub(crate) second: usize,
    /// Maximum number of power iterations.
    pub(crate) iterations: usize,
    /// Maximum number of candidate pairs; more are rejected (40 000 take 400 MB).
    pub(crate) max_pairs: usize,
    /// Maximum number of edges; more are rejected (8 bytes each).
    pub(crate) max_edges: usize,
}

impl Default for Sc2Pcr {
    fn default() -> Self {
        Self {
            orientation: true,
            seeds: 0.2,
            first: 30,
            second: 20,
            iterations: 10,
            max_pairs: 40_000,
            max_edges: 30_000_000,
        }
    }
}

impl Component for Sc2Pcr {
    const NAME: &'static str = "sc2-pcr";
    const SUMMARY: &'static str = "the best of the poses of seeds with their most compatible pairs, to second order";
    const SOURCE: &'static str = "Chen, Sun, Yang, Tao, SC2-PCR: a second order spatial compatibility for efficient and \
                                  robust point cloud registration, 2022";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "the number of pairs that a pose explains, over the poses of the seeds' consensus sets"),
        ("exact", "no: only poses of seeds are examined"),
        ("time", "K²/2 pair tests for K candidate pairs, then E K/64 operations for a fifth of E coherent ones"),
    ];

    fn check(&self) -> Result<(), String> {
        let some = self.seeds > 0.0 && self.seeds <= 1.0;
        in_range(some, "seeds", self.seeds, "a fraction above 0, at most 1")?;
        let fewer = (NEEDED..=self.first).contains(&self.second);
        in_range(fewer, "second", self.second, "3 or more, at most `first`")?;
        in_range(self.iterations > 0, "iterations", self.iterations, "1 or more")?;
        in_range(self.max_pairs >= NEEDED, "max-pairs", self.max_pairs, "3 or more candidate pairs")?;
        in_range(self.max_edges > 0, "max-edges", self.max_edges, "1 or more")
    }
}

/// The agreement 1 − (d/Δ)² of two pairs whose distances differ by half of the tolerance.
const TIGHT: f32 = 0.75;
/// Number of pairs of a consensus set in a small problem.
const FEW: usize = 4;

impl Search for Sc2Pcr {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let graph = Association::of(problem);
        let affinity = Affinity::of(problem, &graph, self.max_edges, |off| 1.0 - off * off)?;
        let count = graph.vertices.len();
        let mut tight = BitMatrix::zeros(count);
        affinity.each(|v, w, weight| {
            if weight > TIGHT {
                tight.connect(v, w);
            }
        });
        let mut pair_tests = graph.pair_tests;
        // The published code takes four pairs if there are fewer than the first stage takes.
        let stages = if count < self.first { [FEW; 2] } else { [self.first, self.second] };
        let mut best = BestPose::default();
        for seed in self.seeds(problem, &graph, &affinity, &mut pair_tests) {
            let neighbours: Vec<usize> = graph.adjacency.ones(seed).collect();
            pair_tests += (neighbours.len() + count) as u64;
            let second_order = |w: &usize| shared(tight.row(seed), tight.row(*w), 0);
            let mut ranked: Vec<(usize, usize)> = neighbours.iter().map(|w| (second_order(w), *w)).collect();
            ranked.sort_unstable_by_key(|&(common, w)| (std::cmp::Reverse(common), w));
            let set: Vec<usize> =
                std::iter::once(seed).chain(ranked.into_iter().map(|(_, w)| w)).take(stages[0]).collect();
            if let Some(pose) = self.pose(problem, &graph, &set, stages[1]) {
                let (_, inliers) = scored(problem, &graph.vertices, &pose, |_| 1.0);
                best.offer(inliers as f64, pose);
            }
        }
        best.conclude(problem, &graph.vertices, self.orientation, pair_tests, None)
    }
}

impl Sc2Pcr {
    /// The seeds: vertices by descending confidence, local maxima within Δ in the model first.
    fn seeds(
        &self,
        problem: &Problem<'_>,
        graph: &Association,
        affinity: &Affinity,
        pair_tests: &mut u64,
    ) -> Vec<usize> {
        let count = graph.vertices.len();
        let (mut x, mut next, mut plain) = (vec![1.0; count], vec![0.0; count], vec![0.0; count]);
        for _ in 0..self.iterations {
            affinity.products(&x, &mut next, &mut plain);
            *pair_tests += affinity.edges() as u64;
            if !normalized(&mut next) {
                break;
            }
            std::mem::swap(&mut x, &mut next);
        }
        let order = by_weight(&x);
        let max = ((self.seeds * count as f64) as usize).max(NEEDED);
        let mut chosen: Vec<usize> = Vec::new();
        let mut rest = Vec::new();
        for v in order {
            if chosen.len() == max {
                break;
            }
            let pair = graph.vertices[v];
            let near = |other: &usize| {
                let other = graph.vertices[*other];
                let apart = problem.model[other.model].at.distance(&problem.model[pair.model].at);
                apart < slack(problem, pair)
            };
            // A pair beside one of greater weight is no local maximum; those are all earlier in the order.
            *pair_tests += (chosen.len() + rest.len()) as u64;
            if chosen.iter().chain(&rest).any(near) { rest.push(v) } else { chosen.push(v) }
        }
        let more = max.saturating_sub(chosen.len());
        chosen.extend(rest.into_iter().take(more));
        chosen
    }

    /// The weighted pose of the second stage of a seed's set; `None` for fewer than three pairs.
    fn pose(
        &self,
        problem: &Problem<'_>,
        graph: &Association,
        set: &[usize],
        second: usize,
    ) -> Option<Transform<Object, Camera>> {
        let adjacent = |a: usize, b: usize| a == b || graph.adjacency.row(a)[b / 64] >> (b % 64) & 1 == 1;
        let shared_in_set = |&w: &usize| set.iter().filter(|&&u| adjacent(set[0], u) && adjacent(w, u)).count();
        let mut ranked: Vec<usize> = (0..set.len()).collect();
        ranked.sort_by_key(|&place| std::cmp::Reverse(shared_in_set(&set[place])));
        let pairs: Vec<Correspondence> =
            ranked.into_iter().take(second).map(|place| graph.vertices[set[place]]).collect();
        if pairs.len() < NEEDED {
            return None;
        }
        let agreement = |a: Correspondence, b: Correspondence| {
            if a.model == b.model || a.cloud == b.cloud {
                return 0.0;
            }
            let known = problem.model[a.model].at.distance(&problem.model[b.model].at);
            let off = (known - problem.measured(a.cloud, b.cloud)) / problem.delta(a, b);
            (1.0 - off * off).max(0.0)
        };
        let matrix: Vec<Vec<f64>> = pairs.iter().map(|&a| pairs.iter().map(|&b| agreement(a, b)).collect()).collect();
        let mut weights = vec![1.0; pairs.len()];
        for _ in 0..self.iterations {
            let product = |row: &Vec<f64>| row.iter().zip(&weights).map(|(m, x)| m * x).sum();
            let mut next: Vec<f64> = matrix.iter().map(product).collect();
            if !normalized(&mut next) {
                return None;
            }
            weights = next;
        }
        let data = Observations::of(&pairs, problem.model, problem.cloud, None);
        Some(fit_weighted(&data.points, |k| weights[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Sc2Pcr::default().check(), Ok(()));
        assert!(Sc2Pcr { seeds: 0.0, ..Sc2Pcr::default() }.check().is_err());
        assert!(Sc2Pcr { second: 31, ..Sc2Pcr::default() }.check().is_err());
    }
}
