//! Guided seeds: the poses of well-connected pairs in a large graph.

use seafix_geometry::UncertainPoint;

use super::{
    super::{
        bits::{is_set, ones, shared},
        bound::distortion,
        graph::ConsistencyGraph,
        likelihood::PairTerms,
        places::Places,
    },
    COMPARED, Seeds,
};
use crate::{
    observations::Observation,
    search::{bitset::BitMatrix, consensus::motion::Motion, limits::NEEDED},
    solve::closed_form::fit as least_squares,
};

/// Minimum number of model points with a pair in a large problem.
///
/// Smaller problems are enumerated within a fraction of the budget.
pub(in crate::search) const LARGE: usize = 256;
/// Number of the best connected vertices that are seeds first, so that a good pose is known early.
const FIRST: usize = 64;
/// Number of beginnings of a seed, of its neighbours that may join, and maximum size of a beginning.
const BEGINNINGS: usize = 3;
const TOP: usize = 40;
const JOINED: usize = 12;
/// −ln of the probability of missing a set of interest: once in 10⁴ problems that have one beside the best.
const LN_MISSED: f64 = 9.2;
/// Fraction of the members of a set that lead to it as seeds. It is above three quarters on descriptor correspondences
/// with 3.7 % true pairs, and above nine tenths with 9 %.
const LEADING: f64 = 0.5;
/// Part of the work of the seeds that the enumeration may take once a set of interest would have been found: a word of
/// the enumeration takes several times as long.
const ENUMERATED: u64 = 8;
/// Mean residual cost of a true pair (nats).
const RESIDUAL: f64 = 1.5;

impl Seeds<'_> {
    /// Adds guided seeds to the search of a large problem, and to one whose enumeration reaches its budget.
    ///
    /// A set of interest has at least m members, each of which is a seed with the same probability. If s of N vertices
    /// that can belong to such a set were seeds, and a fraction f of the members leads to the set, the search misses it
    /// with the probability (1 − s/N)^(fm) ≤ e^(−fms/N). Once that is 10⁻⁴, the set counts as found and the enumeration
    /// of the triples need not end. The seeds take at most the work `limit`, on top of the budget.
    pub(in crate::search) fn guided(mut self, limit: u64) -> Self {
        self.guided = limit;
        self
    }

    /// Lets the guided seeds suffice, whatever their number: the answer is compared with a sample of wrong poses.
    pub(in crate::search) fn sampled(mut self, suffices: bool) -> Self {
        self.sampled = suffices;
        self
    }

    /// Follows guided seeds and sets the limit of the enumeration. Returns whether a set of interest would have been
    /// found.
    pub(super) fn guide(&mut self) -> bool {
        if self.guided == 0 || self.climb.graph.starts.len() <= LARGE {
            return false;
        }
        let found = self.follow_seeds() || self.sampled;
        let left = if found { self.budget.min(self.spent / ENUMERATED) } else { self.budget };
        self.budget = self.spent.saturating_add(left);
        found
    }

    /// Follows guided seeds after an enumeration that reached its budget. Returns whether a set of interest would have
    /// been found.
    pub(super) fn guide_the_rest(&mut self) -> bool {
        self.guided > 0 && self.climb.graph.starts.len() <= LARGE && self.follow_seeds()
    }

    fn follow_seeds(&mut self) -> bool {
        let graph = self.climb.graph;
        let adjacency = symmetric(graph);
        let places = Places::of(self.climb.terms);
        let mut order: Vec<(usize, usize)> =
            ones(&self.free, 0).map(|v| (shared(adjacency.row(v), &self.free, 0), v)).collect();
        order.sort_unstable_by_key(|&(degree, v)| (std::cmp::Reverse(degree), v));
        let until = self.spent.saturating_add(self.guided);
        let count = order.len();
        let stride = stride(count);
        for step in 0..FIRST.min(count) + count {
            // Afterwards every vertex in an order that is even in the degrees.
            let place = if step < FIRST.min(count) { step } else { (step - FIRST.min(count)) * stride % count };
            let min = self.fewest();
            let able = order.partition_point(|&(degree, _)| degree + 1 >= min);
            let seeds = step.saturating_sub(FIRST) as f64 * able as f64 / count as f64;
            if seeds * LEADING * min as f64 >= LN_MISSED * able as f64 {
                return true;
            }
            if self.spent > until {
                return false;
            }
            if order[place].0 + 1 >= min {
                self.lead(&adjacency, &places, order[place].1, min);
            }
        }
        true
    }

    /// The minimum number of members of a set of interest, with residuals as noise demands.
    fn fewest(&self) -> usize {
        let (threshold, ranks) = (self.threshold(), self.climb.graph.starts.len() - 1);
        let cost = |k: usize| (RESIDUAL * k as f64 - 3.0).max(0.0) - distortion(k);
        let enough = (0..=ranks).find(|&k| self.bounds.reach(0, 0.0, k) - cost(k) >= threshold);
        enough.unwrap_or(ranks + 1).max(self.parts.full)
    }

    /// Follows one seed: its neighbours that share most neighbours with it (second-order compatibility) begin a set.
    fn lead(&mut self, adjacency: &BitMatrix, places: &Places, seed: usize, min: usize) {
        let row: Vec<u64> = adjacency.row(seed).iter().zip(&self.free).map(|(row, free)| row & free).collect();
        let mut ranked: Vec<(usize, usize)> = ones(&row, 0).map(|v| (shared(&row, adjacency.row(v), 0), v)).collect();
        self.spent += ranked.len() as u64 * row.len() as u64;
        ranked.retain(|&(common, _)| common + 2 >= min);
        if ranked.len() + 1 < min {
            return;
        }
        best_connected_first(&mut ranked);
        let mut tried: Vec<usize> = Vec::new();
        for _ in 0..BEGINNINGS {
            let Some(&(_, second)) = ranked.iter().find(|(_, v)| !tried.contains(v)) else { return };
            let joined = joined(adjacency, &[seed, second], &ranked);
            tried.extend(&joined[1..]);
            if joined.len() < NEEDED {
                continue;
            }
            let held =
                |mode: &crate::search::consensus::likelihood::Mode| joined.iter().filter(|&&v| mode.holds(v)).count();
            if self.modes.iter().take(COMPARED).any(|mode| held(mode) >= NEEDED) {
                return;
            }
            if self.follow_beginning(&joined, places) {
                return;
            }
        }
    }

    /// Follows the pose of some pairs to its mode; true if the mode is of interest.
    fn follow_beginning(&mut self, joined: &[usize], places: &Places) -> bool {
        let crate::search::consensus::local_maxima::Climb { terms, graph, .. } = self.climb;
        self.spent += super::COST_OF_A_MODE + graph.vertices.len() as u64 / 16;
        let Some(motion) = fitted(terms, joined) else { return false };
        let Some(mut members) = places.near(terms, graph, &motion, NEEDED) else { return false };
        members.retain(|&v| is_set(&self.free, v));
        let gains: f64 = members.iter().map(|&v| self.bounds.gain_of_rank(graph.rank[v] as usize)).sum();
        let threshold = self.threshold();
        if members.len() < NEEDED || self.bounds.of_set(members.len(), gains) < threshold {
            return false;
        }
        let climbed = |set: &[usize]| !self.climbed.insert(set.to_vec());
        let mode = self.climb.from(&members, &motion, threshold, climbed);
        self.spent += super::COST_OF_A_PAIR * self.climb.compared.take();
        let known = self.modes.len();
        mode.into_iter().for_each(|mode| self.keep(mode));
        self.modes.len() > known
    }
}

/// Sorts neighbours by falling number of common neighbours, and keeps the first [`TOP`].
fn best_connected_first(ranked: &mut Vec<(usize, usize)>) {
    let by = |&(common, v): &(usize, usize)| (std::cmp::Reverse(common), v);
    if ranked.len() > TOP {
        ranked.select_nth_unstable_by_key(TOP, by);
        ranked.truncate(TOP);
    }
    ranked.sort_unstable_by_key(by);
}

/// Some pairs and those of `ranked`, the first first, that are compatible with all of them.
fn joined(adjacency: &BitMatrix, begun: &[usize], ranked: &[(usize, usize)]) -> Vec<usize> {
    let mut joined = begun.to_vec();
    for &(_, v) in ranked {
        if joined.len() < JOINED && joined.iter().all(|&other| is_set(adjacency.row(other), v)) {
            joined.push(v);
        }
    }
    joined
}

/// The beginning of a seed and its neighbours, each with its number of common neighbours; `None` below three pairs.
pub(in crate::search::consensus) fn beginning(
    adjacency: &BitMatrix,
    seed: usize,
    mut neighbours: Vec<(usize, usize)>,
) -> Option<Vec<usize>> {
    best_connected_first(&mut neighbours);
    Some(joined(adjacency, &[seed], &neighbours)).filter(|joined| joined.len() >= NEEDED)
}

/// The least-squares motion of some pairs; `None` if it is not finite.
pub(in crate::search::consensus) fn fitted(terms: &PairTerms, members: &[usize]) -> Option<Motion> {
    let observed = |&v: &usize| Observation {
        measured: UncertainPoint::isotropic(terms.pairs[v].cloud.into(), 0.0),
        pixels: None,
        model: terms.pairs[v].model.into(),
        model_sigma: 0.0,
    };
    let points: Vec<Observation> = members.iter().map(observed).collect();
    let pose = least_squares(&points);
    pose.is_finite().then(|| Motion::of(&pose.inverse()))
}

/// The adjacency with both directions of every edge.
pub(in crate::search::consensus) fn symmetric(graph: &ConsistencyGraph) -> BitMatrix {
    let count = graph.vertices.len();
    let mut adjacency = BitMatrix::zeros(count);
    (0..count).for_each(|v| adjacency.row_mut(v).copy_from_slice(graph.row(v)));
    adjacency.mirror_upper();
    adjacency
}

/// A step without a common divisor with `count`, near the golden section of it: its multiples are spread evenly.
pub(in crate::search) fn stride(count: usize) -> usize {
    let coprime = |a: &usize| {
        let (mut a, mut b) = (*a, count);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    ((count as f64 * 0.618) as usize..count).find(coprime).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_visited_once() {
        for count in [1, 2, 6, 64, 97, 1000] {
            let mut places: Vec<usize> = (0..count).map(|k| k * stride(count) % count).collect();
            places.sort_unstable();
            assert_eq!(places, Vec::from_iter(0..count));
        }
    }
}
