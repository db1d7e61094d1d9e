//! The acceptance of a search that weighs evidence.

use super::{
    judge::Judge,
    outcome::Outcome,
    probability::{Evidence, Probability},
    rejection::RejectionReason,
};
use crate::{
    ablation::AcceptanceTest,
    alternative::Alternative,
    problem::Correspondence,
    search::{
        consensus::influential_pairs::misled,
        identification::Identification,
        posterior::{Explanation, Posterior},
    },
};

impl Judge<'_> {
    /// The outcome of a search that weighs evidence, and the probabilities of its pose.
    ///
    /// A pose is accepted if it is improbable to be wrong and no second copy of the object exists.
    pub(super) fn accept_posterior(
        &self,
        found: &Identification,
        posterior: &Posterior,
        evidence: &Evidence<'_>,
        probability: Probability,
    ) -> (Outcome, Option<Alternative>, Probability) {
        let max = self.acceptance.max_p_wrong;
        let runner_up = posterior.next(&self.anchors, self.alert_limit).map(Explanation::alternative);
        let with_copies = evidence.with_copies();
        let suffices = |ln_evidence: f64| evidence.is_copy(ln_evidence, max.value());
        if self.acceptance.with(AcceptanceTest::SecondCopies)
            && max.allows(with_copies.absent)
            && let Some(best) = posterior.explanations.first()
            && let Some(copy) = posterior.copy(&self.anchors, self.alert_limit, suffices)
        {
            let copies = Outcome::Ambiguous(vec![best.alternative(), copy.alternative()]);
            return (copies, None, with_copies.among(2));
        }
        if let Err(rejection) = self.check_p_wrong(probability.absent, [&found.pairs, &found.edges]) {
            return (Outcome::Rejected(rejection), runner_up, probability);
        }
        if !max.allows(probability.wrong)
            && max.allows(evidence.without_influential_pairs().wrong)
            && let Some(rejection) = self.influential_rejection(posterior)
        {
            return (Outcome::Rejected(rejection), runner_up, probability);
        }
        if !max.allows(probability.wrong) {
            let elsewhere = posterior.elsewhere(&self.anchors, self.alert_limit);
            if elsewhere.is_empty() {
                let rejection = self.improbable(probability.wrong, [&found.pairs, &found.edges]);
                return (Outcome::Rejected(rejection), runner_up, probability);
            }
            let all = posterior.explanations.first().into_iter().chain(elsewhere);
            return (Outcome::Ambiguous(all.map(Explanation::alternative).collect()), None, probability);
        }
        // The protection levels cover single wrong matches by themselves.
        let (mut outcome, _) = self.poses(found, Some(evidence.without_influential_pairs().wrong));
        if let Outcome::Ambiguous(all) = &outcome {
            let probability = probability.among(all.len());
            return (outcome, runner_up, probability);
        }
        if let (Outcome::Fix(fix), Some(best)) = (&mut outcome, posterior.explanations.first()) {
            // The solver sees only the pairs: its pose must agree with the pose whose evidence was computed.
            if self.apart(&fix.object_from_camera, &best.object_from_camera) {
                let solved = fix.clone().alternative();
                return (Outcome::Ambiguous(vec![best.alternative(), solved]), None, probability.among(2));
            }
            fix.score = best.ln_evidence;
            let near = posterior.explanations[1..]
                .iter()
                .map(|other| ((other.ln_evidence - best.ln_evidence).exp(), &other.object_from_camera));
            let near = near.filter(|(_, other)| !self.apart(&fix.object_from_camera, other));
            self.cover(fix, near.collect::<Vec<_>>().into_iter());
        }
        (outcome, runner_up, probability)
    }

    /// Whether the object's absence, or a pose in general, is improbable enough for a pose of these points and edges.
    pub(super) fn check_p_wrong(
        &self,
        probability: f64,
        identified: [&[Correspondence]; 2],
    ) -> Result<(), RejectionReason> {
        match self.acceptance.max_p_wrong.allows(probability) {
            true => Ok(()),
            false => Err(self.improbable(probability, identified)),
        }
    }

    /// The rejection of a pose by the pairs that most probably mislead it.
    fn influential_rejection(&self, posterior: &Posterior) -> Option<RejectionReason> {
        let worst = misled(&posterior.influential_pairs, self.alert_limit).1?;
        let points = worst.pairs.iter().map(|pair| self.problem.model[pair.model].id.clone()).collect();
        Some(RejectionReason::InfluentialPairs { points, rms: worst.error(), limit: self.alert_limit })
    }

    fn improbable(&self, p_wrong: f64, [pairs, edges]: [&[Correspondence]; 2]) -> RejectionReason {
        let (model, max) = (self.problem.model.len(), self.acceptance.max_p_wrong);
        let edges = [edges.len(), self.problem.edges.model.len()];
        RejectionReason::Absent { p_wrong, max, identified: pairs.len(), model, edges }
    }
}
