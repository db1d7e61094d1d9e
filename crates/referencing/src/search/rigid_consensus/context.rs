//! What the stages of one search share.

use std::collections::BTreeSet;

use super::super::{
    consensus::{
        clutter_density::ClutterDensity,
        edge_seeds::edge_modes,
        edge_terms::EdgeTerms,
        graph::ConsistencyGraph,
        joined::Joined,
        likelihood::{Mode, PairTerms},
        local_maxima::Climb,
        prior_terms::PriorTerms,
        seeds::{Seeds, Swept},
    },
    posterior::Explanation,
};
use crate::{
    ablation::SearchMechanism,
    problem::{Correspondence, Problem},
};

/// Minimum evidence (nats) of a pose that may be accepted, a probability of absence of 2.2 %; only then are
/// alternatives searched for.
pub(super) const STRONG: f64 = 3.8;
/// Maximum number of poses whose evidence is weighed with the local density of clutter.
pub(super) const MAX_COMPARED: usize = 64;

/// One problem with the terms of its evidence.
pub(super) struct Context<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) parts: (&'a PairTerms, &'a PriorTerms, &'a ConsistencyGraph),
    /// The terms of edges, if the problem has any.
    pub(super) edges: Option<EdgeTerms<'a>>,
    /// Whether there are candidates enough for a pose of points alone.
    pub(super) by_points: bool,
    /// No points or lines taken.
    pub(super) none: BTreeSet<usize>,
    /// The mechanisms left out.
    pub(super) without: &'a [SearchMechanism],
}

impl Context<'_> {
    pub(super) fn with(&self, mechanism: SearchMechanism) -> bool {
        !self.without.contains(&mechanism)
    }

    /// The ascent among all pairs.
    pub(super) fn climb(&self) -> Climb<'_> {
        Climb::new(self.problem.model, self.parts, &self.none)
    }

    /// A search for sets of `min` pairs and the evidence `floor` (nats) without the cloud points in `taken`.
    pub(super) fn seeds<'s>(&'s self, taken: &'s BTreeSet<usize>, min_floor: (usize, f64), budget: u64) -> Seeds<'s> {
        Seeds::new(self.problem.model, self.parts, taken, min_floor, budget)
    }

    /// Weighs the modes with the local density of clutter and sorts them; the cloud points in `other` are no clutter.
    pub(super) fn weigh(&self, density: &mut ClutterDensity, swept: &mut Swept, other: &[usize]) {
        for mode in &mut swept.modes {
            density.weigh(self.problem, self.parts, mode, other);
        }
        swept.modes.sort_by(Mode::by_evidence);
    }

    /// Adds edges to the modes of points, and the modes of edges; `taken` are the cloud points and lines not to be used.
    pub(super) fn add_edges(&self, [taken, lines]: [&BTreeSet<usize>; 2], swept: &mut Swept) {
        let Some(edges) = &self.edges else { return };
        let climb = Climb::new(self.problem.model, self.parts, taken);
        let joined = Joined { climb: &climb, edges, taken: lines };
        // A mode of points alone sees none of the edges.
        swept.modes.iter_mut().for_each(|mode| {
            mode.ln_evidence += edges.ln_fraction[0];
            mode.ln_uniform = mode.ln_evidence;
        });
        let near = |mode: &Mode| joined.near(&mode.motion, None, f64::NEG_INFINITY);
        let upgraded: Vec<Mode> = swept.modes.iter().take(MAX_COMPARED).filter_map(near).collect();
        let found = edge_modes(&joined, &upgraded, &mut swept.pair_tests);
        swept.insert(upgraded);
        swept.insert(found);
    }

    /// The pairs of model edges and lines of a mode.
    pub(super) fn edge_pairs(&self, mode: &Mode) -> Vec<Correspondence> {
        self.edges.as_ref().map_or_else(Vec::new, |edges| mode.edge_pairs(edges))
    }

    pub(super) fn explanation(&self, mode: &Mode) -> Explanation {
        let (_, _, graph) = self.parts;
        Explanation {
            pairs: mode.pairs(graph),
            edges: self.edge_pairs(mode),
            object_from_camera: mode.motion.transform().inverse(),
            ln_evidence: mode.ln_evidence,
            ln_clutter_density: mode.ln_clutter_density,
        }
    }
}
