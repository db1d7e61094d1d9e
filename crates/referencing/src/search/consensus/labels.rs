//! Putative pairs that mistake model points for their like.

use super::{
    graph::ConsistencyGraph,
    likelihood::{Mode, Terms, ln_fraction},
    structured_clutter::{Occupied, StructuredClutter},
};
use crate::{
    Problem,
    a_contrario::{Shuffled, shuffled},
};

/// Fewer mistakes than this at one pose are no pattern.
const FEW: usize = 4;
/// Places that are not further apart than this many variances (three standard deviations) are one.
const APART: f64 = 9.0;
/// Chance is never sure.
const MAX_PROBABILITY: f64 = 0.99;
/// So many poses are looked at, the likeliest.
const MAX: usize = 24;

impl Occupied<'_> {
    /// What poses that put the model onto the same places in another order say of the pairs.
    ///
    /// A grid, a ring or a frame stands as well in many ways. Where appearance proposes partners among points that look alike (the
    /// corners of a frame, the bolts of a row), each of these ways is met by as many pairs as chance makes of the alike, and the
    /// likeliest is but the one that has most. Shuffled over all partners, those that lie at the place of model point i are met with
    /// m_i q_i, m_i its partners and q_i the share of all that lie there. If the poses elsewhere have S of F such places together,
    ///
    /// Λ = B(S, F)/Π m_i q_i Π (1 − m_i q_i)
    ///
    /// is the evidence that they are met more often. Then the likeliest pose, with k of n points, is one of them with the share
    /// B(k + S, n + F), as many as they are, or stands out with B(k, n) · B(S, F).
    ///
    /// `None` of pairs that nobody proposed, and where no other pose is met.
    pub(in crate::search) fn mistaken(
        &self,
        problem: &Problem<'_>,
        (terms, graph): (&Terms, &ConsistencyGraph),
        others: &[Mode],
    ) -> Option<StructuredClutter> {
        if !shuffled(problem) {
            return None;
        }
        // Seldom is there a pose to ask.
        let mut nfa = None;
        let variance = terms.pairs.iter().map(|pair| pair.variance).fold(0.0, f64::max);
        let (mut met, mut places, mut ln_nfa, mut poses) = (0, 0, 0.0, 0);
        for other in others.iter().take(MAX) {
            let mistakes = |v: &&usize| !self.best.holds(**v) && self.holds_place(problem, terms, graph, **v);
            let mistaken: Vec<usize> =
                other.members.iter().filter(mistakes).map(|&v| graph.vertices[v].model).collect();
            if mistaken.len() < FEW {
                continue;
            }
            poses += 1;
            let nfa = nfa.get_or_insert_with(|| Shuffled::of(problem));
            for (i, point) in problem.model.iter().enumerate() {
                let (place, of_best) = (other.motion.apply(&point.at.coords), self.best.motion.apply(&point.at.coords));
                let met_at_random = nfa.meets(i, place).min(MAX_PROBABILITY);
                // Where both put the point, nothing is told of mistakes.
                if met_at_random <= 0.0 || (place - of_best).norm_squared() <= APART * variance {
                    continue;
                }
                places += 1;
                let is_met = mistaken.contains(&i);
                met += usize::from(is_met);
                ln_nfa += libm::log(if is_met { met_at_random } else { 1.0 - met_at_random });
            }
        }
        let (k, n) = (self.best.members.len(), problem.candidates.with_candidates());
        (poses > 0 && met > 0).then(|| StructuredClutter {
            ln_evidence: ln_fraction(met, places) - ln_nfa,
            ln_alone: ln_fraction(k + met, n + places) - ln_fraction(k, n) - ln_fraction(met, places)
                + libm::log((poses + 1) as f64),
        })
    }
}
