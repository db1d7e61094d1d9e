//! What is believed of a search that weighs evidence.

use super::{Alternative, Outcome, absence::Absence, judge::Judge};
use crate::{Belief, Explanation, Identification, chance::Chance};

impl Judge<'_> {
    /// The pose of a search that weighs evidence: believed when little speaks for no object at all, little
    /// for a pose elsewhere, nothing for a second copy of the object, and chance hardly ever gives as good a set.
    pub(super) fn weighed(
        &self,
        found: &Identification,
        belief: &Belief,
        chance: &Chance<'_>,
    ) -> (Outcome, Option<Alternative>) {
        let shares = belief.shares(self.problem.model, self.alert_limit);
        let elsewhere = belief.elsewhere(self.problem.model, self.alert_limit);
        let runner_up = belief.next(self.problem.model, self.alert_limit).map(Explanation::alternative);
        let absence = Absence::of(self, found, &shares, chance);
        // Two things that are each the object by themselves: neither is the other's clutter.
        let even = shares.absent - shares.clutter;
        if absence.refusal(even).is_none()
            && let Some(best) = belief.explanations.first()
            && let Some(copy) = belief.copy(self.problem.model, self.alert_limit, absence.most().max(even))
        {
            return (Outcome::Ambiguous(vec![best.alternative(), copy.alternative()]), None);
        }
        if let Some(refusal) = absence.refusal(shares.absent) {
            return (Outcome::Unidentified(refusal), runner_up);
        }
        if let Err(refusal) = self.rare(found.pairs.len(), chance.sets_as_good()) {
            return (Outcome::Unidentified(refusal), runner_up);
        }
        // Written so that a NaN is refused too.
        if !(shares.elsewhere <= self.acceptance.doubt * (1.0 - shares.absent)) {
            let all = belief.explanations.first().into_iter().chain(elsewhere);
            return (Outcome::Ambiguous(all.map(Explanation::alternative).collect()), None);
        }
        let (mut outcome, _) = self.poses(found, Some(shares.elsewhere + shares.absent));
        if let (Outcome::Referenced(reference), Some(best)) = (&mut outcome, belief.explanations.first()) {
            // The solver has the pairs alone: what it makes of them must be the pose that was weighed.
            if self.apart(&reference.object_from_camera, &best.object_from_camera) {
                let solved = reference.clone().alternative();
                return (Outcome::Ambiguous(vec![best.alternative(), solved]), None);
            }
            reference.score = best.ln_evidence;
            let near = belief.explanations[1..]
                .iter()
                .map(|other| ((other.ln_evidence - best.ln_evidence).exp(), &other.object_from_camera));
            let near = near.filter(|(_, other)| !self.apart(&reference.object_from_camera, other));
            self.cover(reference, near.collect::<Vec<_>>().into_iter());
        }
        (outcome, runner_up)
    }
}
