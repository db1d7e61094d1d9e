//! Structured clutter: evidence from the cloud itself that clutter resembles the object.

use nalgebra::Vector3;

use super::{
    fractions::ln_fraction,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    prior_terms::PriorTerms,
};
use crate::{problem::Problem, search::alike::slack};

/// The evidence of clutter that resembles the object, from a pose elsewhere.
///
/// Uniform clutter shows a pose of evidence Λ in about one of Λ frames. A pose *elsewhere* of that evidence, in places
/// where the best pose has no point of the object, shows that clutter is not uniform: it repeats the object's own
/// distances (as several structures of its kind). The best pose may then be such clutter too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructuredClutter {
    /// ln evidence that clutter resembles the object (nats): that of the pose elsewhere, given its pairs that the best
    /// pose explains as the object's, over the places that the best pose leaves free.
    pub ln_evidence: f64,
    /// ln likelihood ratio (nats) of absence over presence, given that clutter resembles the object.
    ///
    /// Absence: the best pose is such clutter too, with one visible fraction for the places of both poses. Presence:
    /// the object has a visible fraction of its own.
    pub ln_alone: f64,
}

/// The places of the model points under the best pose.
pub(in crate::search) struct ModelPlaces<'a> {
    pub(super) best: &'a Mode,
    /// Sorted along the first axis.
    places: Vec<Vector3<f64>>,
    /// Model points without a counterpart in clutter: the points outside the pattern of a model with one.
    distinctive: Vec<bool>,
}

impl<'a> ModelPlaces<'a> {
    pub(in crate::search) fn of(problem: &Problem<'_>, best: &'a Mode, distinctive: Option<Vec<bool>>) -> Self {
        let mut places: Vec<Vector3<f64>> =
            problem.model.iter().map(|point| best.motion.apply(&point.at.coords)).collect();
        places.sort_by(|a, b| a.x.total_cmp(&b.x));
        Self { best, places, distinctive: distinctive.unwrap_or_else(|| vec![false; problem.model.len()]) }
    }

    fn near(&self, place: &Vector3<f64>, off: f64) -> bool {
        let from = self.places.partition_point(|p| p.x < place.x - off);
        let mut beside = self.places[from..].iter().take_while(|p| p.x <= place.x + off);
        beside.any(|p| (p - place).norm_squared() <= off * off)
    }

    /// Whether a pair's cloud point lies at a place of the object under the best pose.
    pub(in crate::search) fn holds_place(
        &self,
        problem: &Problem<'_>,
        terms: &PairTerms,
        graph: &ConsistencyGraph,
        v: usize,
    ) -> bool {
        self.near(&terms.pairs[v].cloud, slack(problem, graph.vertices[v]))
    }

    /// The structured clutter that another pose shows.
    ///
    /// Among its k′ pairs those whose cloud point lies at a place of the object are the object's own. Given these,
    /// which determine most of the pose, the other s of f free places have the evidence Λ(all)/Λ(own) with the
    /// probability B(s, f). With k of n points at the best pose, such clutter shows both with the probability B(k + s,
    /// n + f), the object with B(k, n)·B(s, f). Points without a counterpart in clutter count for the object alone.
    pub(in crate::search) fn structured_clutter(
        &self,
        problem: &Problem<'_>,
        (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
        other: &Mode,
    ) -> StructuredClutter {
        let model = |v: &usize| graph.vertices[*v].model;
        let off = other.members.iter().map(|&v| slack(problem, graph.vertices[v])).fold(0.0, f64::max);
        let (own, free): (Vec<usize>, Vec<usize>) =
            other.members.iter().partition(|&&v| self.near(&terms.pairs[v].cloud, off));
        let mut distinctive = self.distinctive.clone();
        free.iter().for_each(|v| distinctive[model(v)] = false);
        let mut seen = vec![false; distinctive.len()];
        other.members.iter().for_each(|v| seen[model(v)] = true);
        let unseen = |i: &usize| !seen[*i] && !self.near(&other.motion.apply(&problem.model[*i].at.coords), off);
        let (all, imitable) = (distinctive.len(), distinctive.iter().filter(|&&distinctive| !distinctive).count());
        let (s, empty) = (free.len(), (0..all).filter(unseen).count());
        let f = s + (0..all).filter(|i| !distinctive[*i]).filter(unseen).count();
        let (distinctive_members, k): (Vec<usize>, Vec<usize>) =
            self.best.members.iter().partition(|v| distinctive[model(v)]);
        let ln_distinctive: f64 =
            distinctive_members.iter().map(|&v| terms.residual_gain(v, &self.best.motion).max(0.0)).sum();
        let given = other.ln_evidence_of(terms, prior_terms, &own) + ln_fraction(other.members.len(), all);
        StructuredClutter {
            // `given` assumes uniform clutter; sparser clutter must not count as structure.
            ln_evidence: other.ln_evidence + other.ln_clutter_density.min(0.0) - given + ln_fraction(s, s + empty),
            ln_alone: ln_fraction(k.len() + s, imitable + f)
                - ln_fraction(k.len(), imitable)
                - ln_fraction(s, f)
                - ln_distinctive,
        }
    }
}
