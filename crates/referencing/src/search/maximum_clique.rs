//! Maximum clique: the largest admissible set, with a proof.

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    alike::all_alike,
    association::Association,
    clique::{self, MAX_ORIENTED},
    grow::{feasible, so_far},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, MAX_TIES, NEEDED, bounded},
    maximum_clique_edges,
    orientation::{Sense, unmirrored, wholly_mirrored},
};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::closed_form::fit as least_squares,
};

/// The largest admissible set of correspondences, as a maximum clique of the consistency graph.
///
/// Every two pairs are coherent, the set is one-to-one, and no four pairs are a mirror image of the model. The answer
/// is exact within the budget. Among sets of one size the minimum residual of a rigid fit decides, then the
/// coordinates. Time O(K²) for the graph of K candidate pairs, then exponential in K at worst.
///
/// With edges, one graph holds the candidate pairs of both kinds, and the size counts points and edges alike. A point and
/// an edge agree by the distance from the line and by the place along it; two edges by the angle of their directions, by
/// their signed distance and by their places along the lines, each within its own standard deviations. Triples with an
/// edge are tested for mirror images as quadruples of points are. Lines without measured depth are not used. A problem
/// without edges is searched as before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MaximumClique {
    /// Whether mirror images are rejected; `false` compares distances only, as in the paper.
    pub orientation: bool,
    /// Maximum number of pair tests beyond the tests that build the graph.
    pub budget: u64,
    /// Maximum number of alternatives in the answer, those with the fewest common pairs first.
    ///
    /// It applies only if all sets of the same size are proved to give the same pose as the best; otherwise the answer
    /// holds all sets found.
    pub alternatives: usize,
    /// Maximum number of candidate pairs; more are rejected, since their graph would not fit into memory (40 000 pairs
    /// take 200 MB).
    pub max_pairs: usize,
}

impl Default for MaximumClique {
    fn default() -> Self {
        Self { orientation: true, budget: BUDGET, alternatives: 64, max_pairs: 40_000 }
    }
}

impl Component for MaximumClique {
    const NAME: &'static str = "maximum-clique";
    const VERSION: u32 = 4;
    const SUMMARY: &'static str = "the largest coherent, one-to-one, unmirrored set, by branch and bound";
    const SOURCE: &'static str = "San Segundo, Rodríguez-Losada, Jiménez, An exact bit-parallel algorithm for the \
                                  maximum clique problem, 2011; the graph: Bailey et al., 2000";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of pairs, every two coherent, one-to-one, no four of them mirrored; among equals the minimum residual",
        ),
        ("exact", "within its budget; the answer states whether it is proved, and the bound"),
        ("time", "K²/2 pair tests for K candidate pairs, then exponential at worst"),
        ("features", "points and straight edges"),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for MaximumClique {
    fn takes_edges(&self) -> bool {
        true
    }

    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        if problem.edges.with_candidates() > 0 {
            return maximum_clique_edges::search(self, problem);
        }
        feasible(problem, self.max_pairs)?;
        let budget = self.budget;
        let graph = Association::of(problem);
        // The rest is for the proof that equally large sets are alike.
        let fraction = budget - budget / 4;
        let sense = if self.orientation { Sense::Proper } else { Sense::Any };
        let mut cliques = clique::Search::new(problem, &graph, sense, fraction);
        let largest = cliques.run(1, MAX_TIES);
        let size = largest.found.first().map_or(0, Vec::len);
        if size < NEEDED {
            let pair_tests = graph.pair_tests + (fraction - cliques.left());
            return match largest.complete {
                true => Err(Rejected::NoConsensus { best: size, needed: NEEDED }),
                false => {
                    let ended = Rejected::Budget { budget, best: size, bound: largest.bound, pair_tests };
                    so_far(problem, self.orientation, ended)
                }
            };
        }
        if self.orientation && largest.complete && size == NEEDED {
            self.refuse_mirrored(problem, &graph, &mut cliques)?;
        }
        let larger_image = self.larger_image(size, &mut cliques);
        let mut ties = largest.found;
        let best = min_residual(problem, &graph.vertices, &ties);
        let clique = ties.swap_remove(best);
        let mut pairs = pairs_of(&graph, &clique);
        let mut alternatives: Vec<Vec<Correspondence>> = ties.iter().map(|clique| pairs_of(&graph, clique)).collect();
        Self::different_first(&pairs, &mut alternatives);
        let mut pair_tests = graph.pair_tests + (fraction - cliques.left());
        let (mut optimal, mut all) = (largest.complete, largest.all);
        let mut decided = all;
        if !all || alternatives.len() > self.alternatives {
            let (alike, spent) = all_alike(problem, &graph, &pairs, sense, budget - fraction + cliques.left());
            pair_tests += spent;
            if alike {
                decided = true;
                all = all && alternatives.len() <= self.alternatives;
                alternatives.truncate(self.alternatives);
            }
        }
        if self.orientation && size > MAX_ORIENTED {
            // In the order of the graph: the dropped members do not depend on the order of the points.
            let kept = unmirrored(problem, clique.iter().map(|&vertex| graph.vertices[vertex]).collect(), budget);
            pair_tests += kept.pair_tests;
            optimal = optimal && kept.complete && kept.pairs.len() == size;
            all = all && optimal;
            pairs = kept.pairs;
            pairs.sort_unstable();
        }
        let undecided = larger_image.or_else(|| {
            (!decided).then_some(Rejected::Budget { budget, best: pairs.len(), bound: largest.bound, pair_tests })
        });
        Ok(Identification {
            edges: Vec::new(),
            pairs,
            alternatives,
            alternative_edges: Vec::new(),
            alternatives_complete: all,
            optimal,
            consensus_bound: largest.bound,
            pair_tests,
            undecided,
            posterior: None,
        })
    }
}

impl MaximumClique {
    /// Rejects three points that are the remainder of a mirror image.
    ///
    /// Three points have no orientation. If distances alone give a larger set that is entirely a mirror image, the
    /// three belong to that image.
    fn refuse_mirrored(
        &self,
        problem: &Problem<'_>,
        graph: &Association,
        cliques: &mut clique::Search<'_>,
    ) -> Result<(), Rejected> {
        cliques.set_sense(Sense::Any);
        let coherent = cliques.run(NEEDED + 1, 1);
        cliques.set_sense(Sense::Proper);
        match coherent.found.first().map(|clique| pairs_of(graph, clique)) {
            Some(set) if wholly_mirrored(problem, &set) => Err(Rejected::Mirrored { best: set.len(), proved: true }),
            _ => Ok(()),
        }
    }

    /// A mirror image of the model with more points than the best set.
    ///
    /// The best set is then a planar part of that image and no fix.
    fn larger_image(&self, size: usize, cliques: &mut clique::Search<'_>) -> Option<Rejected> {
        if !self.orientation {
            return None;
        }
        cliques.set_sense(Sense::Mirrored);
        let images = cliques.run(size + 1, 1);
        cliques.set_sense(Sense::Proper);
        images.found.first().map(|image| Rejected::Mirrored { best: image.len(), proved: false })
    }

    /// Sorts the alternatives by ascending number of pairs in common with the best set.
    fn different_first(best: &[Correspondence], alternatives: &mut [Vec<Correspondence>]) {
        alternatives.sort_by_cached_key(|alternative| {
            (alternative.iter().filter(|pair| best.binary_search(pair).is_ok()).count(), alternative.clone())
        });
    }
}

/// The pairs of a clique, in the order of the model points.
fn pairs_of(graph: &Association, clique: &[usize]) -> Vec<Correspondence> {
    let mut pairs: Vec<Correspondence> = clique.iter().map(|&vertex| graph.vertices[vertex]).collect();
    pairs.sort_unstable();
    pairs
}

/// The index of the set with the minimum residual of a rigid fit.
///
/// Residuals that differ by rounding only are equal; then the coordinates decide, which order the vertices: the answer
/// does not depend on the order of the cloud.
pub(super) fn min_residual(problem: &Problem<'_>, vertices: &[Correspondence], cliques: &[Vec<usize>]) -> usize {
    let quantum = 1e-9 * problem.model.iter().map(|point| point.at.coords.amax()).fold(f64::MIN_POSITIVE, f64::max);
    let rank = |clique: &[usize]| {
        let pairs: Vec<Correspondence> = clique.iter().map(|&vertex| vertices[vertex]).collect();
        let data = Observations::of(&pairs, problem.model, problem.cloud, None);
        (data.residual_rms(&least_squares(&data.points)) / quantum).round()
    };
    let ranks: Vec<f64> = cliques.iter().map(|clique| rank(clique)).collect();
    // `min_by` keeps the first of equals, and the cliques are sorted.
    (0..cliques.len()).min_by(|&a, &b| ranks[a].total_cmp(&ranks[b])).expect("a clique")
}

#[cfg(test)]
mod tests;
