//! The acceptance of a search that weighs evidence.

use super::{Alternative, Outcome, absence::Absence, judge::Judge};
use crate::{Explanation, Identification, Posterior, a_contrario::AContrario};

impl Judge<'_> {
    /// The outcome of a search that weighs evidence.
    ///
    /// A pose is accepted if absence and other poses are improbable, no second copy of the object exists, and the NFA
    /// is small.
    pub(super) fn weighted(
        &self,
        found: &Identification,
        posterior: &Posterior,
        a_contrario: &AContrario<'_>,
    ) -> (Outcome, Option<Alternative>) {
        let probabilities = posterior.probabilities(self.problem.model, self.alert_limit);
        let elsewhere = posterior.elsewhere(self.problem.model, self.alert_limit);
        let runner_up = posterior.next(self.problem.model, self.alert_limit).map(Explanation::alternative);
        let absence = Absence::of(self, found, &probabilities, a_contrario);
        // Two sets that each explain the object are copies; neither is clutter of the other.
        let even = probabilities.absent - probabilities.clutter;
        if absence.rejection(even).is_none()
            && let Some(best) = posterior.explanations.first()
            && let Some(copy) = posterior.copy(self.problem.model, self.alert_limit, absence.max().max(even))
        {
            return (Outcome::Ambiguous(vec![best.alternative(), copy.alternative()]), None);
        }
        if let Some(rejection) = absence.rejection(probabilities.absent) {
            return (Outcome::Rejected(rejection), runner_up);
        }
        if let Err(rejection) = self.rare(found.pairs.len(), a_contrario.sets_as_good()) {
            return (Outcome::Rejected(rejection), runner_up);
        }
        // A NaN is rejected as well.
        if !(probabilities.elsewhere <= self.acceptance.doubt * (1.0 - probabilities.absent)) {
            let all = posterior.explanations.first().into_iter().chain(elsewhere);
            return (Outcome::Ambiguous(all.map(Explanation::alternative).collect()), None);
        }
        let (mut outcome, _) = self.poses(found, Some(probabilities.elsewhere + probabilities.absent));
        if let (Outcome::Fix(fix), Some(best)) = (&mut outcome, posterior.explanations.first()) {
            // The solver sees only the pairs: its pose must agree with the pose whose evidence was computed.
            if self.apart(&fix.object_from_camera, &best.object_from_camera) {
                let solved = fix.clone().alternative();
                return (Outcome::Ambiguous(vec![best.alternative(), solved]), None);
            }
            fix.score = best.ln_evidence;
            let near = posterior.explanations[1..]
                .iter()
                .map(|other| ((other.ln_evidence - best.ln_evidence).exp(), &other.object_from_camera));
            let near = near.filter(|(_, other)| !self.apart(&fix.object_from_camera, other));
            self.cover(fix, near.collect::<Vec<_>>().into_iter());
        }
        (outcome, runner_up)
    }
}
