//! Backtracking over subsets of the model points.

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::{feasible, max_possible, so_far},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, MAX_TIES, NEEDED, bounded},
    maximum_clique::min_residual,
    orientation::{Sense, wholly_mirrored},
    volumes::Volumes,
};
use crate::problem::{Correspondence, Problem};

/// Backtracking with forward checking (Haralick and Elliott 1980): the largest admissible set, without a graph.
///
/// The answer is that of `maximum-clique`. Each subset of model points is visited once, in place of the paper's ordered
/// samples, one candidate after the other; nothing below a contradicting pair is visited. A choice removes
/// contradicting candidates from the lists of later points (forward checking). A branch ends if the points that still
/// have candidates are too few to exceed the best (bound).
///
/// Exact within the budget. Among sets of one size the minimum residual of a rigid fit decides, then the coordinates.
/// Exponential in the worst case: Π (m_i + 1) for lists of m_i.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Backtracking {
    /// Whether mirror images are rejected; `false` compares distances only, as in the paper.
    pub(crate) orientation: bool,
    /// Whether branches too small to exceed the best are pruned; `false` serves to show that pruning loses nothing.
    pub(crate) bound: bool,
    /// Maximum number of pair tests.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for Backtracking {
    fn default() -> Self {
        Self { orientation: true, bound: true, budget: BUDGET, max_pairs: 40_000 }
    }
}

impl Component for Backtracking {
    const NAME: &'static str = "backtracking";
    const SUMMARY: &'static str = "the largest admissible set by subsets of the model points, with forward checking";
    const SOURCE: &'static str = "Haralick, Elliott, Increasing tree search efficiency for constraint satisfaction \
                                  problems, 1980";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of pairs, every two coherent, one-to-one, no four of them mirrored; among equals the minimum residual",
        ),
        ("exact", "within its budget; the answer states whether it is proved"),
        ("time", "exponential at worst: Π (m + 1) over lists of m candidates; no graph"),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for Backtracking {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        let volumes = Volumes::of(problem, &vertices);
        let mut run = Run {
            problem,
            vertices: &vertices,
            volumes: &volumes,
            bound: self.bound,
            sense: if self.orientation { Sense::Proper } else { Sense::Any },
            left: self.budget,
            best: 0,
            found: Vec::new(),
            cap: 1,
        };
        let (budget, possible) = (self.budget, max_possible(problem));
        let complete = run.largest(1, MAX_TIES);
        let mut ties = std::mem::take(&mut run.found);
        let size = ties.first().map_or(0, Vec::len);
        if size < NEEDED {
            let pair_tests = self.budget - run.left;
            return match complete {
                true => Err(Rejected::NoConsensus { best: size, needed: NEEDED }),
                false => {
                    let ended = Rejected::Budget { budget, best: size, bound: possible, pair_tests };
                    so_far(problem, self.orientation, ended)
                }
            };
        }
        let mut undecided = None;
        if self.orientation {
            // Three points have no orientation: they may be the remainder of a larger mirror image.
            run.sense = if size == NEEDED { Sense::Any } else { Sense::Mirrored };
            run.largest(size + 1, 1);
            if let Some(image) = run.found.first().map(|set| run.pairs(set)) {
                let mirrored = Rejected::Mirrored { best: image.len(), proved: complete };
                match (size == NEEDED, wholly_mirrored(problem, &image)) {
                    (true, true) => return Err(mirrored),
                    (_, true) => undecided = Some(mirrored),
                    _ => {}
                }
            }
        }
        let pair_tests = self.budget - run.left;
        ties.sort();
        let alternatives_complete = complete && ties.len() < MAX_TIES;
        let best = ties.swap_remove(min_residual(problem, &vertices, &ties));
        let bound = if complete { size } else { possible };
        if !alternatives_complete && undecided.is_none() {
            undecided = Some(Rejected::Budget { budget, best: size, bound, pair_tests });
        }
        Ok(Identification {
            edges: Vec::new(),
            alternatives: ties.iter().map(|set| run.pairs(set)).collect(),
            alternative_edges: Vec::new(),
            alternatives_complete,
            optimal: complete,
            undecided,
            posterior: None,
            ..Identification::unproved(run.pairs(&best), bound, pair_tests)
        })
    }
}

/// The budget is spent.
struct Spent;

struct Run<'a> {
    problem: &'a Problem<'a>,
    vertices: &'a [Correspondence],
    volumes: &'a Volumes<'a>,
    bound: bool,
    sense: Sense,
    left: u64,
    /// Minimum size of interest.
    best: usize,
    /// Sets of that size, vertices ascending.
    found: Vec<Vec<usize>>,
    cap: usize,
}

impl Run<'_> {
    /// Finds the largest sets of at least `min` members, up to `cap`; true if the search is complete.
    fn largest(&mut self, min: usize, cap: usize) -> bool {
        (self.best, self.cap, self.found) = (min, cap, Vec::new());
        let all: Vec<usize> = (0..self.vertices.len()).collect();
        // Points with few candidates first: their contradictions prune early.
        let mut lists: Vec<Vec<usize>> =
            all.chunk_by(|&a, &b| self.vertices[a].model == self.vertices[b].model).map(<[usize]>::to_vec).collect();
        lists.sort_by_key(Vec::len);
        self.extend(&mut Vec::new(), &lists).is_ok()
    }

    /// Visits the sets that begin with `set` and continue with some of these lists, in their order.
    fn extend(&mut self, set: &mut Vec<usize>, lists: &[Vec<usize>]) -> Result<(), Spent> {
        for (place, list) in lists.iter().enumerate() {
            if self.bound && set.len() + lists.len() - place < self.best {
                return Ok(());
            }
            for &vertex in list {
                let rest = self.checked(set, vertex, &lists[place + 1..])?;
                set.push(vertex);
                self.keep(set);
                let done = self.extend(set, &rest);
                set.pop();
                done?;
            }
        }
        Ok(())
    }

    fn keep(&mut self, set: &[usize]) {
        if set.len() > self.best {
            (self.best, self.found) = (set.len(), Vec::new());
        }
        if set.len() == self.best && self.found.len() < self.cap {
            let mut set = set.to_vec();
            set.sort_unstable();
            self.found.push(set);
        }
    }

    /// The lists without candidates that contradict `set` with `vertex`; empty lists are dropped.
    fn checked(&mut self, set: &[usize], vertex: usize, lists: &[Vec<usize>]) -> Result<Vec<Vec<usize>>, Spent> {
        let mut planes = Vec::new();
        if self.sense != Sense::Any {
            for (i, &a) in set.iter().enumerate() {
                planes.extend(set[..i].iter().map(|&b| self.volumes.plane([a, b, vertex])));
            }
        }
        let mut rest = Vec::with_capacity(lists.len());
        for list in lists {
            let mut pair_tests = 0;
            let stays = |other: &usize| {
                pair_tests += 1;
                self.problem.coherent(self.vertices[vertex], self.vertices[*other]) && {
                    pair_tests += planes.len() as u64;
                    !planes.iter().any(|plane| self.volumes.rejects(self.sense, plane, *other))
                }
            };
            let kept: Vec<usize> = list.iter().copied().filter(stays).collect();
            self.left = self.left.saturating_sub(pair_tests);
            if self.left == 0 {
                return Err(Spent);
            }
            if !kept.is_empty() {
                rest.push(kept);
            }
        }
        Ok(rest)
    }

    /// The pairs of some vertices, in the order of the model points.
    fn pairs(&self, set: &[usize]) -> Vec<Correspondence> {
        let mut pairs: Vec<Correspondence> = set.iter().map(|&vertex| self.vertices[vertex]).collect();
        pairs.sort_unstable();
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Backtracking::default().check(), Ok(()));
        assert!(Backtracking { budget: 0, ..Backtracking::default() }.check().is_err());
        assert!(Backtracking { max_pairs: 2, ..Backtracking::default() }.check().is_err());
    }
}
