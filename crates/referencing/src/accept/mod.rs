//! Acceptance: the tests between a search's result and a fix or a rejection.

use rand::Rng;
use seafix_geometry::StereoRig;

use crate::{
    a_contrario::AContrario,
    ablation::AcceptanceTest,
    problem::{Correspondence, Problem},
    search::identification::{Identification, Rejected, Search},
    site::{bounding_box::BoundingBox, model::ModelPoint, target::diameter},
    solve::{
        degeneracy::{Degenerate, ON_A_LINE, second_ratio},
        solver::Solver,
    },
};

pub(crate) mod acceptance;
mod admitted;
pub(crate) mod apart;
mod exclusion;
pub(crate) mod expanding_gates;
mod hypothesis;
pub(crate) mod integrity;
mod judge;
pub(crate) mod max_p_wrong;
mod mislabeled;
pub(crate) mod outcome;
mod posterior_gate;
pub(crate) mod probability;
mod rejection;
mod self_symmetry;
mod transfer;

pub use crate::alternative::Alternative;
pub use acceptance::Acceptance;
pub use apart::rms_apart;
pub use expanding_gates::{search_with_expanding_gates, wider};
pub use integrity::{Consistency, Integrity, Protection, Redundancy};
pub use max_p_wrong::MaxPWrong;
pub use outcome::{Attempt, BestPose, Fix, Outcome};
pub use rejection::RejectionReason;

use judge::Judge;
use probability::{Evidence, Probability};

/// One attempt at a fix after Stage 1: search (Stage 2), rigid motion, acceptance tests.
///
/// `problem` holds model, cloud and candidates; `search` selects the pairs; `solver` computes the pose; `acceptance`
/// holds the limits of the tests. Solvers that minimise reprojection errors need the `rig`. The search draws its random
/// numbers from `rng`.
pub fn compute_fix(
    problem: &Problem<'_>,
    search: &dyn Search,
    solver: &dyn Solver,
    acceptance: &Acceptance,
    rig: Option<&StereoRig>,
    rng: &mut dyn Rng,
) -> Attempt {
    let found = search.search(problem, rng);
    judge(problem, found, solver, acceptance, rig)
}

/// The second half of [`compute_fix()`]: pose and acceptance tests of a search's result.
///
/// Callers that time the search separately use it.
pub fn judge(
    problem: &Problem<'_>,
    found: Result<Identification, Rejected>,
    solver: &dyn Solver,
    acceptance: &Acceptance,
    rig: Option<&StereoRig>,
) -> Attempt {
    let found = match found {
        Ok(found) => found,
        Err(why) => {
            let attempt = Attempt::without(why);
            let outcome = on_a_line(problem).map_or(attempt.outcome, Outcome::Degenerate);
            return Attempt { outcome, ..attempt };
        }
    };
    let found = match solver.takes_edges() {
        true => found,
        false => Identification { edges: Vec::new(), alternative_edges: Vec::new(), ..found },
    };
    let judge = Judge::of_search(problem, &found, solver, acceptance, rig);
    let a_contrario = AContrario::of(problem, &found.pairs);
    let evidence = Evidence::of(problem, &found, judge.alert_limit, &a_contrario, &acceptance.without);
    let (outcome, runner_up, mut probability) = tested(&judge, &found, &evidence);
    let outcome = decided(outcome, problem, &found);
    // A fix of fewer pairs has a number of false alarms of its own, unless edges or independent pairs determine it.
    let subset = match &outcome {
        Outcome::Fix(fix) if found.edges.is_empty() && !evidence.is_independent() => Some(&fix.pairs),
        _ => None,
    };
    let subset = subset.filter(|pairs| **pairs != found.pairs);
    let nfa = subset.map_or_else(|| evidence.nfa(), |pairs| AContrario::of(problem, pairs).sets_as_good());
    if let (Some(pairs), None) = (subset, &found.posterior) {
        probability = Probability::counted(problem, pairs);
    }
    let best = match &outcome {
        Outcome::Fix(_) | Outcome::Degenerate(_) => None,
        Outcome::Ambiguous(all) => all.first().and_then(|first| judge.best_pose(&first.pairs, &first.edges)),
        Outcome::Rejected(_) => judge.best_pose(&found.pairs, &found.edges),
    };
    // A proof for the complete set does not hold for a subset.
    let thinned = matches!(&outcome, Outcome::Fix(fix) if fix.pairs.len() < found.pairs.len() || fix.edges.len() < found.edges.len());
    Attempt {
        nfa: Some(nfa),
        p_absent: Some(probability.absent),
        p_wrong: Some(probability.wrong),
        best,
        outcome,
        runner_up,
        optimal: found.optimal && !thinned,
        consensus_bound: Some(found.consensus_bound),
        pair_tests: Some(found.pair_tests),
        copies_sought: found.posterior.as_ref().and_then(|posterior| posterior.copies_sought),
        evidence_gap: found.posterior.as_ref().and_then(|posterior| posterior.evidence_gap),
        identified: found.pairs,
        identified_edges: found.edges,
    }
}

/// The outcome of the acceptance tests, the runner-up, and the probabilities of the outcome.
fn tested(
    judge: &Judge<'_>,
    found: &Identification,
    evidence: &Evidence<'_>,
) -> (Outcome, Option<Alternative>, Probability) {
    let probability = evidence.probability();
    let rejected = |rejection| (Outcome::Rejected(rejection), None, probability);
    let (outcome, runner_up, mut probability) = match (judge.size(&found.pairs, &found.edges), &found.posterior) {
        (Err(rejection), _) => rejected(rejection),
        (Ok(()), Some(posterior)) => judge.accept_posterior(found, posterior, evidence, probability),
        (Ok(()), None) => match judge.check_p_wrong(probability.wrong, [&found.pairs, &found.edges]) {
            Err(rejection) => rejected(rejection),
            Ok(()) => {
                let (outcome, runner_up) = judge.poses(found, None);
                (outcome, runner_up, probability)
            }
        },
    };
    // The search compares the poses of edges with those of a self-symmetry itself.
    let outcome = match found.edges.is_empty() && judge.acceptance.with(AcceptanceTest::SelfSymmetry) {
        true => judge.check_self_symmetry(outcome, found.posterior.is_some(), &mut probability),
        false => outcome,
    };
    if found.posterior.is_some() {
        return (outcome, runner_up, probability);
    }
    let (outcome, runner_up) = match (outcome, runner_up) {
        (Outcome::Fix(fix), None) => judge.against_elsewhere(fix),
        known => known,
    };
    if let Outcome::Ambiguous(all) = &outcome {
        probability = probability.among(all.len());
    }
    (outcome, runner_up, probability)
}

/// The outcome unless the search left it undecided, or the points of the object determine no pose.
fn decided(outcome: Outcome, problem: &Problem<'_>, found: &Identification) -> Outcome {
    let outcome = match &found.undecided {
        Some(why @ Rejected::Mirrored { .. }) => Outcome::Rejected(why.clone().into()),
        Some(why) if !settled(&outcome, found.optimal) => Outcome::Rejected(why.clone().into()),
        _ => outcome,
    };
    let line = if found.edges.is_empty() { on_a_line(problem) } else { None };
    line.map_or(outcome, Outcome::Degenerate)
}

/// The acceptance of labelled pairs, which no search selected.
///
/// The labels exclude false alarms and alternatives; residuals, precision and prior are tested as in [`judge()`].
pub fn judge_labelled(
    problem: &Problem<'_>,
    pairs: Vec<Correspondence>,
    solver: &dyn Solver,
    acceptance: &Acceptance,
    rig: Option<&StereoRig>,
) -> Attempt {
    let judge = Judge { largest: pairs.len(), ..Judge::of_labelled(problem, solver, acceptance, rig) };
    let consensus_bound = pairs.len();
    let found = Identification::unproved(pairs, consensus_bound, 0);
    let (outcome, runner_up) = match judge.size(&found.pairs, &found.edges) {
        Ok(()) => judge.poses(&found, None),
        Err(rejection) => (Outcome::Rejected(rejection), None),
    };
    let best = match &outcome {
        Outcome::Rejected(_) => judge.best_pose(&found.pairs, &found.edges),
        _ => None,
    };
    Attempt {
        outcome,
        p_absent: None,
        p_wrong: None,
        best,
        identified: found.pairs,
        identified_edges: found.edges,
        runner_up,
        optimal: false,
        consensus_bound: None,
        nfa: None,
        pair_tests: None,
        copies_sought: None,
        evidence_gap: None,
    }
}

/// The degeneracy of three or more model points with candidates on one line.
///
/// Such points determine no pose, whatever the search returned.
fn on_a_line(problem: &Problem<'_>) -> Option<Degenerate> {
    let lists = problem.candidates.lists.iter();
    let places: Vec<_> =
        problem.model.iter().zip(lists).filter(|(_, list)| !list.is_empty()).map(|(p, _)| p.at.coords).collect();
    let ratio = (places.len() >= 3).then(|| second_ratio(places.iter().copied()))?;
    (ratio < ON_A_LINE).then_some(Degenerate::Collinear { ratio, min: ON_A_LINE })
}

/// The distance (m) beyond which two poses are different answers: the alert limit, or its fraction of the model's
/// diameter if that is smaller.
pub(crate) fn alert_limit(model: &[ModelPoint], acceptance: &Acceptance) -> f64 {
    let (max, fraction) = (acceptance.alert_limit, acceptance.alert_fraction);
    // The diameter is at least the longest side of the bounding box, which is cheaper to compute.
    let side = BoundingBox::around(model.iter().map(|point| point.at))
        .map_or(0.0, |bounding_box| (bounding_box.max - bounding_box.min).amax());
    if fraction * side >= max { max } else { max.min(fraction * diameter(model)) }
}

/// Whether sets that the search did not examine cannot change the outcome.
///
/// An unexamined set may contradict a fix, or pass although the examined sets failed. Poses that contradict each other
/// stay ambiguous, and a set too small stays too small if no set is larger.
fn settled(outcome: &Outcome, optimal: bool) -> bool {
    match outcome {
        Outcome::Ambiguous(_) => true,
        Outcome::Rejected(RejectionReason::TooFew { .. } | RejectionReason::Absent { .. }) => optimal,
        _ => false,
    }
}
