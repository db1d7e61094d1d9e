//! The probabilities that the object is absent, and that a pose is not the object's.
//!
//! This file alone turns what a search found into probabilities; the single setting
//! [`Acceptance::max_p_wrong`](super::Acceptance::max_p_wrong) compares them with one number.

use super::max_p_wrong::MaxPWrong;
use crate::{
    a_contrario::{AContrario, absence::by_nfa, expected_sets},
    ablation::AcceptanceTest,
    problem::{Correspondence, Problem},
    search::{
        consensus::edge_nfa::{Counted, of_counted},
        feature_pose::fitted,
        features::FeatureSet,
        identification::Identification,
        limits::NEEDED,
        posterior::{COPY, PosteriorProbabilities},
    },
};

/// The probabilities by which an answer is accepted or rejected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Probability {
    /// The probability that the object is absent.
    pub(super) absent: f64,
    /// The probability that the pose is not the object's: the object is absent, or has another pose.
    pub(super) wrong: f64,
}

impl Probability {
    /// The probabilities with other poses of this probability, given that the object is present.
    pub(super) fn of(absent: f64, elsewhere: f64) -> Self {
        Self { absent, wrong: absent + (1.0 - absent) * elsewhere }
    }

    /// The probabilities of pairs that a search counted.
    ///
    /// Such a search weighs no other pose: another pose that passes the tests makes the answer ambiguous.
    pub(super) fn counted(problem: &Problem<'_>, pairs: &[Correspondence]) -> Self {
        Self::of(by_nfa(expected_sets(problem, pairs)), 0.0)
    }

    /// The probabilities of points and edges that a search counted; as [`counted`](Self::counted) without edges.
    pub(super) fn counted_features(problem: &Problem<'_>, pairs: &[Correspondence], edges: &[Correspondence]) -> Self {
        Self::by_count(problem, pairs, counted_of(problem, pairs, edges))
    }

    fn by_count(problem: &Problem<'_>, pairs: &[Correspondence], with_edges: Option<Counted>) -> Self {
        match with_edges {
            None => Self::counted(problem, pairs),
            // As for a search with a posterior: the most probable kind of absence holds.
            Some(of) => {
                let by_number = by_nfa(libm::exp(of.ln_nfa).min(expected_sets(problem, pairs)));
                Self::of(larger(by_number, by_evidence(&of)), 0.0)
            }
        }
    }

    /// The probabilities for one of `count` poses between which the data do not decide.
    pub(super) fn among(self, count: usize) -> Self {
        Self::of(self.absent, 1.0 - 1.0 / count.max(1) as f64)
    }

    /// The probabilities with further poses of this probability.
    pub(super) fn beside(self, elsewhere: f64) -> Self {
        Self { absent: self.absent, wrong: self.wrong + (1.0 - self.wrong) * elsewhere }
    }

    /// The probabilities of a search without a pose.
    ///
    /// The data show as little of an object with fewer than three visible points as of an absent one, so absence keeps
    /// its prior probability of one half.
    pub(super) const NOTHING_FOUND: Self = Self { absent: 0.5, wrong: 1.0 };
}

/// What speaks for points and edges that a search counted, about their pose; `None` without edges, without a prior, and
/// for features that determine no pose.
fn counted_of(problem: &Problem<'_>, pairs: &[Correspondence], edges: &[Correspondence]) -> Option<Counted> {
    if edges.is_empty() {
        return None;
    }
    let set = FeatureSet { points: pairs.to_vec(), edges: edges.to_vec() };
    let (pose, _) = fitted(problem, &set, None)?;
    of_counted(problem, &set, &pose.inverse())
}

/// The probability of absence by the evidence: of clutter alone, and of another structure of the object's kind.
fn by_evidence(of: &Counted) -> f64 {
    by_nfa(libm::exp(-of.ln_evidence) + libm::exp(of.ln_resembling - of.ln_evidence))
}

/// What is known of a set of pairs: the parts of which its probabilities are made.
pub(super) struct Evidence<'a> {
    problem: &'a Problem<'a>,
    pairs: &'a [Correspondence],
    /// The identified edges.
    edges: &'a [Correspondence],
    /// What speaks for points and edges that a search without a posterior counted.
    counted: Option<Counted>,
    /// The number of false alarms of points and edges together.
    nfa_with_edges: Option<f64>,
    /// The number of false alarms by independent pairs of a large putative set.
    nfa_independent: Option<f64>,
    /// The posterior of the search; `None` for a search that counts pairs.
    posterior: Option<PosteriorProbabilities>,
    /// The probability that a wrong match misleads the pose.
    misled: f64,
    /// The numbers of false alarms, computed on demand.
    a_contrario: &'a AContrario<'a>,
    /// The tests left out.
    without: &'a [AcceptanceTest],
}

impl<'a> Evidence<'a> {
    /// The evidence for the answer of a search; poses within `limit` (m, RMS over the model points) are one answer.
    pub(super) fn of(
        problem: &'a Problem<'a>,
        found: &'a Identification,
        limit: f64,
        a_contrario: &'a AContrario<'a>,
        without: &'a [AcceptanceTest],
    ) -> Self {
        let posterior = found.posterior.as_ref().map(|posterior| posterior.probabilities(&problem.anchors(), limit));
        let misled = found.posterior.as_ref().map_or(0.0, |posterior| posterior.misled(limit));
        let misled = if without.contains(&AcceptanceTest::InfluentialPairs) { 0.0 } else { misled };
        let ln_nfa = found.posterior.as_ref().and_then(|posterior| posterior.ln_nfa);
        let counted = match &found.posterior {
            Some(_) => None,
            None => counted_of(problem, &found.pairs, &found.edges),
        };
        let ln_nfa = counted.map(|of| of.ln_nfa).or(ln_nfa.filter(|_| !found.edges.is_empty()));
        let support = found.posterior.as_ref().and_then(|posterior| posterior.support.as_ref());
        let nfa_independent = support.map(|support| libm::exp(support.ln_nfa));
        Self {
            problem,
            pairs: &found.pairs,
            edges: &found.edges,
            counted,
            nfa_with_edges: ln_nfa.map(libm::exp),
            nfa_independent,
            posterior,
            misled,
            a_contrario,
            without,
        }
    }

    fn with(&self, test: AcceptanceTest) -> bool {
        !self.without.contains(&test)
    }

    /// Whether the number of false alarms is that of independent pairs.
    pub(super) fn is_independent(&self) -> bool {
        self.nfa_independent.is_some()
    }

    /// The probabilities of the answer.
    pub(super) fn probability(&self) -> Probability {
        match self.posterior {
            None => Probability::by_count(self.problem, self.pairs, self.counted),
            Some(posterior) => self.weighted(&posterior).beside(self.misled),
        }
    }

    /// The probabilities if every pair is the object's or all are clutter.
    pub(super) fn without_influential_pairs(&self) -> Probability {
        self.posterior.map_or_else(|| self.probability(), |posterior| self.weighted(&posterior))
    }

    /// The probabilities if a second copy of the object is no clutter.
    ///
    /// Two sets that each explain the object are copies; neither is clutter of the other.
    pub(super) fn with_copies(&self) -> Probability {
        let without =
            |of: PosteriorProbabilities| PosteriorProbabilities { absent: of.absent - of.clutter, clutter: 0.0, ..of };
        self.posterior.map_or_else(|| self.probability(), |posterior| self.weighted(&without(posterior)))
    }

    /// Whether a pose beside the answer counts as a second copy of the object.
    ///
    /// Its evidence `ln_evidence` (nats) would be accepted by itself at `max`, or is nine nats: two possible objects
    /// forbid a choice even if the second is not certain. Limits above that of `balanced` count as it: clutter shows a
    /// pose of less evidence too often, and the posterior weighs such a pose as clutter.
    pub(super) fn is_copy(&self, ln_evidence: f64, max: f64) -> bool {
        ln_evidence >= COPY || 1.0 / (1.0 + libm::exp(ln_evidence)) <= max.min(MaxPWrong::Balanced.value())
    }

    /// The number of false alarms: that of the points or, with edges, the smaller of it and that of all features;
    /// that of independent pairs for a large putative set.
    ///
    /// Each bounds the probability of such an answer without the object.
    pub(super) fn nfa(&self) -> f64 {
        if let Some(independent) = self.nfa_independent {
            return independent;
        }
        match self.nfa_with_edges {
            None => self.a_contrario.sets_as_good(),
            Some(all) if all <= 1e-6 => all,
            Some(all) => all.min(self.a_contrario.sets_as_good()),
        }
    }

    /// The probabilities of an answer with a posterior.
    ///
    /// The posterior weighs the pose against clutter with the density that the frame itself shows. The NFA counts the
    /// poses that clutter without any structure produces, and permuted partners those of mislabelled pairs; each is a
    /// kind of absence that the evidence does not model, and the most probable kind holds.
    fn weighted(&self, posterior: &PosteriorProbabilities) -> Probability {
        let PosteriorProbabilities { absent, elsewhere, .. } = *posterior;
        // Of a present object fewer points than determine a pose are visible with the probability 3/(n + 1); the data
        // are then those of an absent one, and the pose is clutter.
        let unseen = (absent * NEEDED as f64 / (self.problem.model.len() + 1) as f64).min(1.0);
        // Too few edges as well: one at most.
        let edges = self.problem.edges.with_candidates() as f64;
        let unseen = if self.with(AcceptanceTest::FewVisible) { unseen } else { 0.0 };
        let unseen = if self.edges.is_empty() { unseen } else { unseen * (2.0 / (edges + 1.0)).min(1.0) };
        let mut absent_by_any = absent;
        if self.with(AcceptanceTest::PermutedPartners) {
            absent_by_any = larger(absent_by_any, by_nfa(self.a_contrario.at_their_pose()));
        }
        if self.with(AcceptanceTest::Nfa) {
            absent_by_any = larger(absent_by_any, by_nfa(self.nfa()));
        }
        let present = 1.0 - absent;
        Probability::of(absent_by_any, if present > 0.0 { ((elsewhere + unseen) / present).min(1.0) } else { 0.0 })
    }
}

/// The larger of two probabilities; a NaN if one is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evidence of many edges exceeds the range of its exponential.
    #[test]
    fn much_evidence_does_not_overflow() {
        let absent = |ln_evidence, ln_resembling| by_evidence(&Counted { ln_nfa: 0.0, ln_evidence, ln_resembling });
        assert_eq!(absent(2000.0, 1000.0), 0.0);
        assert!((absent(2000.0, 2000.0) - 0.5).abs() < 1e-12);
        assert!((absent(9.0, f64::NEG_INFINITY) / (-9.0_f64).exp() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn other_poses_and_absence_exclude_each_other() {
        let one = Probability::of(0.2, 0.5);
        assert!((one.wrong - 0.6).abs() < 1e-15 && (one.beside(0.5).wrong - 0.8).abs() < 1e-15);
        assert_eq!(one.beside(0.0), one);
        // Four equal poses: three of four are not this one.
        assert_eq!(Probability::of(0.0, 0.0).among(4), Probability::of(0.0, 0.75));
        assert_eq!(one.among(1), Probability::of(0.2, 0.0));
    }
}
