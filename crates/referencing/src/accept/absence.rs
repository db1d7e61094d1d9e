//! The test of the object's presence.

use std::cell::OnceCell;

use super::{RejectionReason, judge::Judge};
use crate::{
    Identification, PosteriorProbabilities, Problem,
    a_contrario::{AContrario, dimension},
};

/// The test of the object's presence, with the data that it needs.
pub(super) struct Absence<'a> {
    judge: &'a Judge<'a>,
    found: &'a Identification,
    probabilities: &'a PosteriorProbabilities,
    a_contrario: &'a AContrario<'a>,
    /// Computed on demand, and once.
    fills_space: OnceCell<bool>,
    rare: OnceCell<bool>,
}

impl<'a> Absence<'a> {
    pub(super) fn of(
        judge: &'a Judge<'a>,
        found: &'a Identification,
        probabilities: &'a PosteriorProbabilities,
        a_contrario: &'a AContrario<'a>,
    ) -> Self {
        Self { judge, found, probabilities, a_contrario, fills_space: OnceCell::new(), rare: OnceCell::new() }
    }

    /// The rejection at this probability of absence; `None` if the object is accepted as present.
    ///
    /// A repeated pattern that resembles the object is no random set: its probability does not depend on the
    /// distribution of the clutter, so it has a limit of its own. Randomly permuted candidates that often yield a set
    /// as large at this pose are a kind of absence that the evidence does not model.
    pub(super) fn rejection(&self, absent: f64) -> Option<RejectionReason> {
        let (min, max) = self.limits();
        let a_contrario = absent - self.probabilities.alike;
        let limit = if min < max && a_contrario > min && self.fills_space() { max } else { min };
        // A NaN is rejected as well.
        let likely = a_contrario <= limit && absent <= max;
        if (likely && self.a_contrario.at_their_pose() <= limit) || self.is_rare() {
            return None;
        }
        let (probability, limit) = match (likely, a_contrario <= limit) {
            (true, _) => (self.a_contrario.at_their_pose().min(1.0), limit),
            (false, true) => (absent, max),
            (false, false) => (a_contrario, limit),
        };
        Some(RejectionReason::Absent { probability, limit })
    }

    /// The largest probability of absence at which a pose can be accepted.
    pub(super) fn max(&self) -> f64 {
        self.limits().1
    }

    /// The limits of the probability of absence: for clutter on lines and surfaces, and for clutter that fills space.
    ///
    /// Both are equal for models up to the reference size. Every number of visible points has the same prior
    /// probability, so each is less probable for a larger model, and clutter that fills space reaches a given evidence
    /// less often. On lines and surfaces each visible point's term of the evidence is overestimated, so the excess
    /// grows with the model.
    fn limits(&self) -> (f64, f64) {
        let larger = (self.judge.problem.model.len() + 1) as f64 / STATED_FOR;
        let stated = self.judge.acceptance.absence;
        if larger <= 1.0 {
            return (stated, stated);
        }
        // The lower limit scales the odds, so that a stated limit near one remains near one for every model.
        let odds = stated / (1.0 - stated) / (larger * larger * larger.sqrt());
        (odds / (1.0 + odds), (stated * larger).min(MAX_ABSENCE.max(stated)))
    }

    /// Whether the clutter fills space, as the evidence assumes.
    fn fills_space(&self) -> bool {
        let fills = || dimension(self.judge.problem, &self.found.pairs).is_some_and(|of| of >= FILLS_SPACE);
        *self.fills_space.get_or_init(fills)
    }

    /// Whether a small NFA justifies the pose despite a probability of absence above its limit.
    ///
    /// The probability of absence assigns the same prior to every number of visible points, which makes few visible
    /// points of a large model improbable; the NFA makes no such assumption. It is reliable enough only for putative
    /// pairs whose cloud fills space: permuted candidates lie wherever the cloud does, while clutter within gates lies
    /// on edges that resemble the object's.
    fn is_rare(&self) -> bool {
        let Problem { cloud, candidates, prior, .. } = self.judge.problem;
        let acceptance = self.judge.acceptance;
        let putative = || prior.is_none() && candidates.lists.iter().any(|list| list.len() < cloud.len());
        *self.rare.get_or_init(|| {
            putative()
                && self.probabilities.absent <= IMPROBABLE
                && self.probabilities.alike <= acceptance.absence
                && self.fills_space()
                && self.a_contrario.sets_as_good() <= acceptance.rare
        })
    }
}

// These four constants are not settings: they define the scale of `acceptance.absence` and `acceptance.rare` and were
// chosen with those defaults on generated problems. Change those two for a stricter or laxer test.

/// Largest probability of absence at which a small NFA can accept an object.
const IMPROBABLE: f64 = 0.05;
/// Upper bound of the limit of the probability of absence, for every model.
const MAX_ABSENCE: f64 = 0.01;
/// Smallest dimension of clutter that fills space; below it clutter lies on lines and surfaces.
const FILLS_SPACE: f64 = 2.3;
/// Number of model points plus one for which [`Acceptance::absence`](super::Acceptance::absence) is stated.
const STATED_FOR: f64 = 9.0;
