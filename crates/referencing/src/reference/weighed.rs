//! What is believed of a search that weighs evidence.

use std::cell::LazyCell;

use super::{Alternative, Outcome, Refusal, judge::Judge};
use crate::{
    Belief, Explanation, Identification, Problem, Shares,
    chance::{dimension, expected_sets_as_good},
};

impl Judge<'_> {
    /// The pose of a search that weighs evidence: believed when little speaks for no object at all, little
    /// for a pose elsewhere, and nothing for a second copy of the object.
    pub(super) fn weighed(&self, found: &Identification, belief: &Belief) -> (Outcome, Option<Alternative>) {
        let shares = belief.shares(self.problem.model, self.alert_limit);
        let elsewhere = belief.elsewhere(self.problem.model, self.alert_limit);
        let runner_up = belief.next(self.problem.model, self.alert_limit).map(Explanation::alternative);
        // Looked at where it decides, and once.
        let fills_space = LazyCell::new(|| self.fills_space(found));
        let rare = LazyCell::new(|| self.rare(found, &shares, || *fills_space));
        let (least, most) = self.absence_limits();
        // A pattern that looks like the object is no chance: how sure its odds are does not depend on where clutter lies.
        let chance = shares.absent - shares.alike;
        let limit = if least < most && chance > least && *fills_space { most } else { least };
        let improbable = |absent: f64| absent - shares.alike <= limit && absent <= most;
        // Two things that are each the object by themselves: neither is the other's clutter.
        let even = shares.absent - shares.clutter;
        if let (true, Some(best), Some(copy)) = (
            improbable(even) || *rare,
            belief.explanations.first(),
            belief.copy(self.problem.model, self.alert_limit, most.max(even)),
        ) {
            return (Outcome::Ambiguous(vec![best.alternative(), copy.alternative()]), None);
        }
        // Written so that a NaN is refused too.
        if !(improbable(shares.absent) || *rare) {
            let (probability, limit) = if chance <= limit { (shares.absent, most) } else { (chance, limit) };
            return (Outcome::Unidentified(Refusal::Absent { probability, limit }), runner_up);
        }
        if !(shares.elsewhere <= self.acceptance.doubt * (1.0 - shares.absent)) {
            let all = belief.explanations.first().into_iter().chain(elsewhere);
            return (Outcome::Ambiguous(all.map(Explanation::alternative).collect()), None);
        }
        let (mut outcome, _) = self.poses(found);
        if let (Outcome::Referenced(reference), Some(best)) = (&mut outcome, belief.explanations.first()) {
            // The solver has the pairs alone: what it makes of them must be the pose that was weighed.
            if self.apart(&reference.object_from_camera, &best.object_from_camera) {
                let solved = Alternative {
                    object_from_camera: reference.object_from_camera,
                    pairs: reference.pairs.clone(),
                    score: reference.score,
                };
                return (Outcome::Ambiguous(vec![best.alternative(), solved]), None);
            }
            reference.score = best.ln_evidence;
        }
        (outcome, runner_up)
    }

    /// The largest probabilities of absence with which a pose is believed: where clutter lies on lines and surfaces, and
    /// where it fills space; of models as small as the limit is stated for they are one.
    ///
    /// Every number of visible points is equally likely beforehand, so that of a larger model each has less, and clutter
    /// that fills space shows a stated evidence the more seldom. On lines and surfaces the evidence, a sum of as many terms
    /// as points are visible, is too sure by something of each: the more, the larger the model.
    fn absence_limits(&self) -> (f64, f64) {
        let larger = (self.problem.model.len() + 1) as f64 / STATED_FOR;
        let stated = self.acceptance.absence;
        if larger <= 1.0 {
            return (stated, stated);
        }
        // The lesser by its odds: of what is stated to be hardly a limit at all, so little is asked of any model.
        let odds = stated / (1.0 - stated) / larger.powi(3);
        (odds / (1.0 + odds), (stated * larger).min(MOST_ABSENCE.max(stated)))
    }

    /// Whether the candidates that are not the object's fill space, as the evidence takes clutter to do.
    fn fills_space(&self, found: &Identification) -> bool {
        dimension(self.problem, &found.pairs).is_some_and(|dimension| dimension >= FILLS_SPACE)
    }

    /// Whether chance gives sets as good so rarely that the pose is believed although absence is not as improbable as it
    /// should be.
    ///
    /// The probability of absence takes every number of visible points to be equally likely, which of a large model makes
    /// few visible ones improbable beforehand; chance is counted without. Only of putative pairs whose points fill space is its
    /// count good enough for that: partners that were shuffled lie wherever the cloud does, while clutter in shells lies on
    /// edges that look like the object's.
    fn rare(&self, found: &Identification, shares: &Shares, fills_space: impl Fn() -> bool) -> bool {
        let Problem { cloud, candidates, prior, .. } = self.problem;
        let putative = prior.is_none() && candidates.lists.iter().any(|list| list.len() < cloud.len());
        putative
            && shares.absent <= IMPROBABLE
            && shares.alike <= self.acceptance.absence
            && fills_space()
            && expected_sets_as_good(self.problem, &found.pairs) <= self.acceptance.rare
    }
}

// These four are no settings: they belong to the scale on which `acceptance.absence` and `acceptance.rare` are stated, and were
// chosen with their defaults on drawn problems. Whoever wants to be stricter or laxer moves those two.

/// An object is not believed whose absence is more probable than this.
const IMPROBABLE: f64 = 0.05;
/// The greatest limit of the probability of absence, whatever the model.
const MOST_ABSENCE: f64 = 0.01;
/// Clutter of fewer dimensions lies on lines and surfaces.
const FILLS_SPACE: f64 = 2.3;
/// The number of points, and one, of the models that [`Acceptance::absence`](super::Acceptance::absence) is stated for.
const STATED_FOR: f64 = 9.0;
