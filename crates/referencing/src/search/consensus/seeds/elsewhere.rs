//! Poses that contradict a known pose.

use super::{
    super::{
        bits::{intersect, is_set, ones},
        graph::ConsistencyGraph,
        likelihood::{Mode, PairTerms},
    },
    Seeds,
};
use crate::search::limits::NEEDED;

/// Number of starting pairs of this search, and number of vertices compared with each.
const BEGINNINGS: usize = 8;
const COMPARED_BEGINNINGS: usize = 512;

impl Seeds<'_> {
    /// Restricts the search to pairs that contradict a pose.
    pub(in crate::search) fn contradicting(mut self, pose: &Mode) -> Self {
        self.free = contradicting(self.climb.terms, self.climb.graph, pose, false);
        self
    }

    /// A pose that contradicts a known one, regardless of its evidence.
    ///
    /// Three pairs that contradict the known pose begin it, and further pairs that fit join. The search starts from the
    /// best connected pairs. `None` if no three of them agree.
    pub(in crate::search) fn elsewhere(mut self, than: &Mode) -> Option<Mode> {
        let graph = self.climb.graph;
        self.free = contradicting(self.climb.terms, graph, than, true);
        let free = std::mem::take(&mut self.free);
        let (mut row, mut common) = (vec![0; free.len()], vec![0; free.len()]);
        for a in self.best_connected(&free, &free, BEGINNINGS) {
            intersect(graph.row(a), &free, &graph.lasts, 0, &mut row);
            let Some(&b) = self.best_connected(&row, &row, 1).first() else { continue };
            intersect(&row, graph.row(b), &graph.lasts, 0, &mut common);
            let Some(&c) = self.best_connected(&common, &common, 1).first() else { continue };
            let after = graph.rank[c] as usize + 1;
            self.of_three = ones(&common, graph.starts[after]).filter(|&v| is_set(graph.row(c), v)).collect();
            self.follow([a, b, c], 0.0);
            let shared = |mode: &Mode| mode.members.iter().filter(|&&v| than.holds(v)).count();
            self.modes.retain(|mode| shared(mode) < NEEDED);
            if !self.modes.is_empty() {
                break;
            }
        }
        self.modes.into_iter().next()
    }

    /// The vertices with most later neighbours in `among`; a large set is decimated evenly.
    fn best_connected(&self, of: &[u64], among: &[u64], max: usize) -> Vec<usize> {
        let graph = self.climb.graph;
        let all: Vec<usize> = ones(of, 0).collect();
        let neighbours =
            |v: usize| -> u32 { graph.row(v).iter().zip(among).map(|(row, other)| (row & other).count_ones()).sum() };
        let some = all.iter().step_by(all.len().div_ceil(COMPARED_BEGINNINGS).max(1));
        let mut counted: Vec<(u32, usize)> = some.map(|&v| (neighbours(v), v)).collect();
        counted.sort_unstable_by_key(|&(count, v)| (std::cmp::Reverse(count), v));
        counted.into_iter().take(max).map(|(_, v)| v).collect()
    }
}

/// The pairs that a pose does not explain, one bit each; with `free`, without the cloud points of its own pairs.
fn contradicting(terms: &PairTerms, graph: &ConsistencyGraph, pose: &Mode, free: bool) -> Vec<u64> {
    let mut taken: Vec<usize> = pose.members.iter().map(|&v| graph.vertices[v].cloud).collect();
    taken.sort_unstable();
    let mut bits = vec![0; graph.vertices.len().div_ceil(64)];
    for (v, pair) in graph.vertices.iter().enumerate() {
        if (!free || taken.binary_search(&pair.cloud).is_err()) && terms.of_pair(v, &pose.motion).is_none() {
            bits[v / 64] |= 1 << (v % 64);
        }
    }
    bits
}
