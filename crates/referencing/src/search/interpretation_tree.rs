//! The interpretation tree: one level a model point, one branch a candidate, and a wild card.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::{admits, conclude, feasible, max_possible, so_far},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED, bounded},
    orientation::Sense,
    pose::{fitted, fraction},
    quadruples::Quadruples,
    volumes::Volumes,
};
use crate::problem::{Correspondence, Problem};

/// Interpretation tree (Grimson and Lozano-Pérez 1987): the longest interpretation that a rigid motion explains.
///
/// Every two pairs are coherent, and each pair is within the tolerance of its place under their least-squares pose (the
/// model test). Depth first, model points in the order of their coordinates, each candidate in turn, and last the wild
/// card for an invisible point.
///
/// The search visits every interpretation longer than the best, unless `enough` stops it at the first that is long
/// enough, as in the original. With `enough` = 1, no set with more points passes the model test; one that is only
/// coherent may exist. Exponential: Π (m_i + 1) for lists of m_i.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct InterpretationTree {
    /// Whether mirror images are rejected; `false` leaves them to the model test.
    pub(crate) orientation: bool,
    /// Fraction of the model points at which an interpretation is accepted at once, above 0 and at most 1.
    ///
    /// It refers to the model points with candidates; 1 searches for the longest interpretation.
    pub(crate) enough: f64,
    /// Maximum number of pair tests.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for InterpretationTree {
    fn default() -> Self {
        Self { orientation: true, enough: 1.0, budget: BUDGET, max_pairs: 40_000 }
    }
}

impl Component for InterpretationTree {
    const NAME: &'static str = "interpretation-tree";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "the longest interpretation that is coherent and passes a rigid fit, depth first";
    const SOURCE: &'static str = "Grimson, Lozano-Pérez, Localizing overlapping parts by searching the interpretation \
                                  tree, 1987";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of pairs, every two coherent and each within the tolerance of its place under their least-squares pose",
        ),
        ("exact", "within its budget, if `enough` is 1"),
        ("time", "exponential: Π (m + 1) over lists of m candidates"),
    ];

    fn check(&self) -> Result<(), String> {
        let fraction = self.enough > 0.0 && self.enough <= 1.0;
        in_range(fraction, "enough", self.enough, "a fraction above 0, at most 1")?;
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for InterpretationTree {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        let volumes = Volumes::of(problem, &vertices);
        let numbers: Vec<usize> = (0..vertices.len()).collect();
        let levels: Vec<&[usize]> = numbers.chunk_by(|&a, &b| vertices[a].model == vertices[b].model).collect();
        let enough = ((self.enough * levels.len() as f64).ceil() as usize).max(NEEDED);
        let mut tree = Tree {
            problem,
            vertices: &vertices,
            volumes: &volumes,
            quadruples: Quadruples::default(),
            levels: &levels,
            settings: self,
            enough,
            best: Vec::new(),
            pair_tests: 0,
        };
        tree.descend(0, &mut Vec::new());
        if tree.best.is_empty() && tree.pair_tests >= self.budget {
            let (budget, pair_tests) = (self.budget, tree.pair_tests);
            let ended = Rejected::Budget { budget, best: 0, bound: max_possible(problem), pair_tests };
            return so_far(problem, self.orientation, ended);
        }
        let ranked: Vec<Correspondence> = tree.best.iter().map(|&v| vertices[v]).collect();
        conclude(problem, &ranked, self.orientation, tree.pair_tests)
    }
}

struct Tree<'a> {
    problem: &'a Problem<'a>,
    vertices: &'a [Correspondence],
    volumes: &'a Volumes<'a>,
    quadruples: Quadruples,
    levels: &'a [&'a [usize]],
    settings: &'a InterpretationTree,
    enough: usize,
    best: Vec<usize>,
    pair_tests: u64,
}

impl Tree<'_> {
    fn descend(&mut self, level: usize, taken: &mut Vec<usize>) {
        // The model test is expensive: only a set that would be the longest takes it.
        if taken.len() >= NEEDED && taken.len() > self.best.len() && self.explained(taken) {
            self.best.clone_from(taken);
        }
        let over = self.pair_tests >= self.settings.budget || self.best.len() >= self.enough;
        if over || taken.len() + self.levels.len() - level <= self.best.len() || level == self.levels.len() {
            return;
        }
        let sense = if self.settings.orientation { Sense::Proper } else { Sense::Any };
        for &vertex in self.levels[level] {
            if admits(self.volumes, &mut self.quadruples, sense, taken, vertex, &mut self.pair_tests) {
                taken.push(vertex);
                self.descend(level + 1, taken);
                taken.pop();
            }
        }
        self.descend(level + 1, taken);
    }

    fn explained(&mut self, taken: &[usize]) -> bool {
        let pairs: Vec<Correspondence> = taken.iter().map(|&v| self.vertices[v]).collect();
        self.pair_tests += pairs.len() as u64;
        let pose = fitted(self.problem, &pairs);
        pose.is_some_and(|pose| pairs.iter().all(|&pair| fraction(self.problem, &pose, pair) <= 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(InterpretationTree::default().check(), Ok(()));
        assert!(InterpretationTree { enough: 0.0, ..InterpretationTree::default() }.check().is_err());
        assert!(InterpretationTree { budget: 0, ..InterpretationTree::default() }.check().is_err());
    }
}
