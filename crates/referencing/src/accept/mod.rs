//! Acceptance: the tests between a search's result and a fix or a rejection.

use rand::Rng;
use seafix_geometry::{Camera, Object, StereoRig, Transform};

use crate::{
    BoundingBox, Correspondence, Degenerate, Identification, ModelPoint, Problem, Rejected, Search, Solver,
    a_contrario::AContrario,
    site::diameter,
    solve::{ON_A_LINE, second_ratio},
};

mod absence;
mod acceptance;
mod admitted;
mod exclusion;
mod expanding_gates;
mod hypothesis;
mod integrity;
mod judge;
mod mislabeled;
mod outcome;
mod posterior_gate;
mod rejection;
mod self_symmetry;
mod transfer;

pub use acceptance::Acceptance;
pub use expanding_gates::{search_with_expanding_gates, wider};
pub use integrity::{Integrity, Protection, Redundancy};
pub use outcome::{Alternative, Attempt, Fix, Outcome};
pub use rejection::RejectionReason;

use judge::Judge;

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
    let alert_limit = alert_limit(problem.model, acceptance);
    let largest = std::iter::once(&found.pairs).chain(&found.alternatives).map(Vec::len).max().unwrap_or(0);
    let judge = Judge { problem, solver, acceptance, alert_limit, largest, searched: true, rig };
    let a_contrario = AContrario::of(problem, &found.pairs);
    let likely = judge.size(&found.pairs).and_then(|()| match found.posterior {
        Some(_) => Ok(()),
        None => judge.a_contrario(&found.pairs),
    });
    let (outcome, runner_up) = match (likely, &found.posterior) {
        (Ok(()), Some(posterior)) => judge.weighted(&found, posterior, &a_contrario),
        (Ok(()), None) => judge.poses(&found, None),
        (Err(rejection), _) => (Outcome::Rejected(rejection), None),
    };
    let outcome = judge.distinguished(outcome, found.posterior.is_some());
    let (outcome, runner_up) = match (outcome, runner_up) {
        (Outcome::Fix(fix), None) if found.posterior.is_none() => judge.against_elsewhere(fix),
        known => known,
    };
    let outcome = match &found.undecided {
        Some(why @ Rejected::Mirrored { .. }) => Outcome::Rejected(why.clone().into()),
        Some(why) if !settled(&outcome, found.optimal) => Outcome::Rejected(why.clone().into()),
        _ => outcome,
    };
    let outcome = on_a_line(problem).map_or(outcome, Outcome::Degenerate);
    let nfa = match &outcome {
        Outcome::Fix(fix) if fix.pairs != found.pairs => AContrario::of(problem, &fix.pairs).sets_as_good(),
        _ => a_contrario.sets_as_good(),
    };
    // A proof for the complete set does not hold for a subset.
    let thinned = matches!(&outcome, Outcome::Fix(fix) if fix.pairs.len() < found.pairs.len());
    Attempt {
        nfa: Some(nfa),
        outcome,
        runner_up,
        optimal: found.optimal && !thinned,
        consensus_bound: Some(found.consensus_bound),
        pair_tests: Some(found.pair_tests),
        copies_sought: found.posterior.as_ref().and_then(|posterior| posterior.copies_sought),
        evidence_gap: found.posterior.as_ref().and_then(|posterior| posterior.evidence_gap),
        identified: found.pairs,
    }
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
    let alert_limit = alert_limit(problem.model, acceptance);
    let judge = Judge { problem, solver, acceptance, alert_limit, largest: pairs.len(), searched: false, rig };
    let consensus_bound = pairs.len();
    let found = Identification::unproved(pairs, consensus_bound, 0);
    let (outcome, runner_up) = match judge.size(&found.pairs) {
        Ok(()) => judge.poses(&found, None),
        Err(rejection) => (Outcome::Rejected(rejection), None),
    };
    Attempt {
        outcome,
        identified: found.pairs,
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
        Outcome::Rejected(
            RejectionReason::TooFew { .. } | RejectionReason::AContrario { .. } | RejectionReason::Absent { .. },
        ) => optimal,
        _ => false,
    }
}

/// The RMS distance (m) between the model points as two poses place them.
pub fn rms_apart(model: &[ModelPoint], a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> f64 {
    let (a, b) = (a.inverse(), b.inverse());
    let sum: f64 = model.iter().map(|point| (a * point.at - b * point.at).norm_squared()).sum();
    (sum / model.len().max(1) as f64).sqrt()
}
