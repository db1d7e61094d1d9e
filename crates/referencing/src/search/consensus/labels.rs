//! Mislabelled putative pairs: matches that confuse model points of similar appearance.

use super::{
    fractions::ln_fraction,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    structured_clutter::{ModelPlaces, StructuredClutter},
};
use crate::{
    a_contrario::{coincidence::Shuffled, coordinates::shuffled},
    problem::Problem,
};

/// Minimum number of wrong pairs at one pose that form a pattern.
const FEW: usize = 4;
/// Squared distance (variances; three standard deviations) up to which two places are one.
const APART: f64 = 9.0;
/// Maximum probability of a random match.
const MAX_PROBABILITY: f64 = 0.99;
/// Maximum number of poses examined, the best first.
const MAX: usize = 24;

impl ModelPlaces<'_> {
    /// The evidence of poses that put the model onto the same places in another order.
    ///
    /// A grid, a ring or a frame has self-symmetries. If a matcher proposes partners among points of similar appearance
    /// (the corners of a frame, the bolts of a row), each of these poses is supported by as many pairs as random
    /// confusion produces, and the best pose is only the one with most. Under a random shuffle of all partners, the
    /// place of model point i gets a match with probability m_i q_i, with its number of partners m_i and the fraction
    /// q_i of all partners that lie there. If the poses elsewhere have matches at S of F such places,
    ///
    /// Λ = B(S, F)/Π m_i q_i Π (1 − m_i q_i)
    ///
    /// is the evidence that these are more frequent than random. The best pose, with k of n points, is then one of them
    /// with the probability B(k + S, n + F), or it stands out with B(k, n) · B(S, F).
    ///
    /// Pairs at random do not decide between the poses, but the measured places do. A pose that has a point at o of n
    /// places has the evidence B(o, n) Gᵒ, with the mean gain G of a pair without a matcher. Each pose elsewhere counts
    /// with this evidence relative to that of the best pose, at most once: where an end of a row is in view, poses
    /// beyond it leave places empty.
    ///
    /// `None` for pairs without a matcher, and if no other pose has matches.
    pub(in crate::search) fn mistaken(
        &self,
        problem: &Problem<'_>,
        (terms, graph): (&PairTerms, &ConsistencyGraph),
        others: &[Mode],
    ) -> Option<StructuredClutter> {
        if !shuffled(problem) {
            return None;
        }
        // Computed on demand: seldom is there a pose to test.
        let mut shuffled = None;
        let variance = terms.pairs.iter().map(|pair| pair.variance).fold(0.0, f64::max);
        let n = problem.candidates.with_candidates();
        let gain = self.mean_gain(problem, terms, graph);
        let (mut met, mut places, mut ln_random, mut poses) = (0, 0, 0.0, 0.0);
        for other in others.iter().take(MAX) {
            let mistakes = |v: &&usize| !self.best.holds(**v) && self.holds_place(problem, terms, graph, **v);
            let mistaken: Vec<usize> =
                other.members.iter().filter(mistakes).map(|&v| graph.vertices[v].model).collect();
            if mistaken.len() < FEW {
                continue;
            }
            let shuffled = shuffled.get_or_insert_with(|| Shuffled::of(problem));
            let (mut of_other, mut of_best_pose) = (0, 0);
            for (i, point) in problem.model.iter().enumerate() {
                let (place, of_best) = (other.motion.apply(&point.at.coords), self.best.motion.apply(&point.at.coords));
                let met_at_random = shuffled.meets(i, place).min(MAX_PROBABILITY);
                of_other += usize::from(met_at_random > 0.0);
                of_best_pose += usize::from(shuffled.meets(i, of_best) > 0.0);
                // A place that both poses share gives no information on confusion.
                if met_at_random <= 0.0 || (place - of_best).norm_squared() <= APART * variance {
                    continue;
                }
                places += 1;
                let is_met = mistaken.contains(&i);
                met += usize::from(is_met);
                ln_random += libm::log(if is_met { met_at_random } else { 1.0 - met_at_random });
            }
            let ln_evidence = |occupied: usize| occupied as f64 * gain + ln_fraction(occupied, n);
            poses += libm::exp((ln_evidence(of_other) - ln_evidence(of_best_pose)).min(0.0));
        }
        let k = self.best.members.len();
        (poses > 0.0 && met > 0).then(|| StructuredClutter {
            ln_evidence: ln_fraction(met, places) - ln_random,
            ln_alone: ln_fraction(k + met, n + places) - ln_fraction(k, n) - ln_fraction(met, places)
                + libm::log(poses),
        })
    }

    /// The mean gain (nats) of the best pose's pairs if every cloud point were a partner of every model point.
    fn mean_gain(&self, problem: &Problem<'_>, terms: &PairTerms, graph: &ConsistencyGraph) -> f64 {
        let gain = |&v: &usize| {
            let partners = problem.candidates.lists[graph.vertices[v].model].len();
            terms.residual_gain(v, &self.best.motion) - libm::log(problem.cloud.len() as f64 / partners as f64)
        };
        self.best.members.iter().map(gain).sum::<f64>() / self.best.members.len().max(1) as f64
    }
}
