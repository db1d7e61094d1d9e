//! Maximal cliques: the best pose of the heaviest cliques through each pair.

use std::rc::Rc;

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    association::Association,
    bitset::{BitMatrix, BitSet},
    grow::feasible,
    hypotheses::{BestPose, scored},
    identification::{Identification, Rejected, Search},
    limits::{NEEDED, bounded},
    pose::fitted,
    second_order::SecondOrder,
};
use crate::problem::{Correspondence, Problem};

/// MAC (Zhang et al. 2023): registration with maximal cliques.
///
/// The weight of two coherent pairs is second-order, w_ab Σ_c w_ac w_bc with w = 1 − (d/Δ)². Every maximal clique of
/// three or more of the graph of positive weights is a hypothesis; the maximum clique alone often belongs to another
/// pose. Each pair keeps the clique of greatest weight through it. The pose with the greatest Σ (1 − r/τ) over its
/// pairs within tolerance is fitted again to them.
///
/// In a dense graph only pairs with a large clustering coefficient take part, as long as fifty do: more than 10, 9.95, …
/// times Otsu's threshold of the coefficients.
///
/// Unlike the authors' program, two pairs of one model or cloud point are not compatible, and no weight is too small: its
/// threshold of 0.99 is made for the noise of one data set.
///
/// Not exact: the number of maximal cliques is exponential at worst, and the budget ends their enumeration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Mac {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Maximum number of weights, sets of the enumeration and residuals beyond the tests that build the graph.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected (40 000 take 200 MB).
    pub(crate) max_pairs: usize,
    /// Maximum number of edges; more are rejected (16 bytes each).
    pub(crate) max_edges: usize,
}

impl Default for Mac {
    fn default() -> Self {
        Self { orientation: true, budget: 2_000_000_000, max_pairs: 40_000, max_edges: 15_000_000 }
    }
}

impl Component for Mac {
    const NAME: &'static str = "mac";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "the best of the poses of the heaviest maximal cliques";
    const SOURCE: &'static str = "Zhang, Yang, Zhang, Zhang, 3D registration with maximal cliques, 2023; the \
                                  enumeration: Bron, Kerbosch, 1973, with the pivot of Tomita, Tanaka, Takahashi, 2006";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "Σ (1 − r/τ) over the pairs that a pose explains, over the poses of maximal cliques"),
        ("exact", "no: each pair keeps its heaviest clique only"),
        ("time", "K²/2 pair tests for K candidate pairs, then exponential at worst, within its budget"),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)?;
        seafix_component::in_range(self.max_edges > 0, "max-edges", self.max_edges, "1 or more")
    }
}

impl Search for Mac {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let graph = Association::of(problem);
        let weights = SecondOrder::of(problem, &graph, self.max_edges, self.budget)?;
        let mut cliques = Cliques::of(&weights, self.budget.saturating_sub(weights.work));
        let mut ended = weights.ended;
        let kept = weights.clustered();
        if !ended {
            ended = cliques.enumerate(&kept).is_err();
        }
        let mut pair_tests = graph.pair_tests + (self.budget - cliques.left);
        let mut best = BestPose::default();
        for clique in cliques.hypotheses() {
            if pair_tests - graph.pair_tests >= self.budget && ended {
                break;
            }
            pair_tests += graph.vertices.len() as u64;
            let pairs: Vec<Correspondence> = clique.iter().map(|&v| graph.vertices[v]).collect();
            if let Some(pose) = fitted(problem, &pairs) {
                let (score, _) = scored(problem, &graph.vertices, &pose, |off| 1.0 - off);
                best.offer(score, pose);
            }
        }
        best.conclude(problem, &graph.vertices, self.orientation, pair_tests, ended.then_some(self.budget))
    }
}

/// The enumeration of maximal cliques, with the heaviest through each vertex.
struct Cliques<'a> {
    weights: &'a SecondOrder,
    adjacency: BitMatrix,
    /// The heaviest clique through each vertex.
    heaviest: Vec<(f64, Option<Rc<Vec<usize>>>)>,
    left: u64,
}

/// The premature end of the enumeration.
struct Stop;

impl<'a> Cliques<'a> {
    fn of(weights: &'a SecondOrder, left: u64) -> Self {
        let count = weights.count();
        Self { weights, adjacency: BitMatrix::zeros(count), heaviest: vec![(0.0, None); count], left }
    }

    /// Visits every maximal clique of the vertices to keep, three members and more.
    fn enumerate(&mut self, keep: &[bool]) -> Result<(), Stop> {
        let count = self.weights.count();
        let kept: Vec<usize> = (0..count).filter(|&v| keep[v]).collect();
        for &v in &kept {
            for (w, weight) in self.weights.row(v).filter(|&(w, _)| w > v && keep[w]) {
                if weight > 0.0 {
                    self.adjacency.connect(v, w);
                }
            }
        }
        let (mut candidates, mut done) = (BitSet::full(count), BitSet::empty(count));
        (0..count).filter(|&v| !keep[v]).for_each(|v| candidates.remove(v));
        for &v in &kept {
            let (mut next, mut excluded) = (candidates.clone(), done.clone());
            next.intersect(self.adjacency.row(v));
            excluded.intersect(self.adjacency.row(v));
            self.expand(&mut vec![v], next, excluded)?;
            candidates.remove(v);
            done.insert(v);
        }
        Ok(())
    }

    /// Bron–Kerbosch with the pivot that has most neighbours among the candidates.
    fn expand(&mut self, clique: &mut Vec<usize>, mut candidates: BitSet, mut done: BitSet) -> Result<(), Stop> {
        self.left = self.left.saturating_sub(1 + candidates.len() as u64);
        if self.left == 0 {
            return Err(Stop);
        }
        if candidates.is_empty() {
            if done.is_empty() && clique.len() >= NEEDED {
                self.keep(clique);
            }
            return Ok(());
        }
        let common = |v: &usize| candidates.common(self.adjacency.row(*v));
        // The first of equals, so that the order of visits is defined.
        let pivot = candidates.iter().chain(done.iter()).map(|v| (common(&v), std::cmp::Reverse(v))).max();
        let mut branches = candidates.clone();
        if let Some((_, std::cmp::Reverse(pivot))) = pivot {
            branches.subtract(self.adjacency.row(pivot), 0);
        }
        for v in branches.iter().collect::<Vec<_>>() {
            let (mut next, mut excluded) = (candidates.clone(), done.clone());
            next.intersect(self.adjacency.row(v));
            excluded.intersect(self.adjacency.row(v));
            clique.push(v);
            let result = self.expand(clique, next, excluded);
            clique.pop();
            result?;
            candidates.remove(v);
            done.insert(v);
        }
        Ok(())
    }

    /// Keeps a clique for the vertices of which it is the heaviest so far.
    fn keep(&mut self, clique: &[usize]) {
        let mut members = BitSet::empty(self.weights.count());
        clique.iter().for_each(|&v| members.insert(v));
        let inner = |&v: &usize| -> f64 {
            self.weights.row(v).filter(|&(w, _)| w > v && members.has(w)).map(|(_, weight)| weight).sum()
        };
        let weight: f64 = clique.iter().map(inner).sum();
        let clique = Rc::new(clique.to_vec());
        for &v in clique.iter() {
            if weight > self.heaviest[v].0 {
                self.heaviest[v] = (weight, Some(Rc::clone(&clique)));
            }
        }
    }

    /// The cliques kept, the heaviest first, each once.
    fn hypotheses(&self) -> Vec<Rc<Vec<usize>>> {
        let mut all: Vec<(f64, Rc<Vec<usize>>)> =
            self.heaviest.iter().filter_map(|(weight, clique)| Some((*weight, clique.clone()?))).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        all.dedup_by(|a, b| Rc::ptr_eq(&a.1, &b.1));
        all.into_iter().map(|(_, clique)| clique).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Mac::default().check(), Ok(()));
        assert!(Mac { budget: 0, ..Mac::default() }.check().is_err());
        assert!(Mac { max_edges: 0, ..Mac::default() }.check().is_err());
    }
}
