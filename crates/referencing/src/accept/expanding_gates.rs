//! Expanding gates: the search is repeated with larger gates, then without a prior.

use super::{
    outcome::{Attempt, Outcome},
    rejection::RejectionReason,
};
use crate::{
    problem::{Prior, PriorBound},
    search::identification::Rejected,
};

/// Growth factors of the gates, in order.
const GROWTH: [f64; 2] = [2.0, 4.0];

/// The wider priors for a displaced object, in order: gates twice and four times as large, then none.
pub fn wider(prior: &Prior) -> Vec<Option<Prior>> {
    let grown = |by: f64| {
        let mut bound = prior.bound.clone();
        match &mut bound {
            PriorBound::Box(half) => *half *= by,
            PriorBound::Gaussian(covariance) => covariance.matrix *= by * by,
        }
        Some(Prior { object_from_camera: prior.object_from_camera, bound })
    };
    GROWTH.map(grown).into_iter().chain([None]).collect()
}

/// The first attempt with a pose, or with several alternatives, over successively wider priors.
///
/// If all fail, the rejection of the first attempt is returned. A wider prior carries less information, so its poses
/// require more evidence, and every further attempt is another opportunity for a false fix.
pub fn search_with_expanding_gates(
    first: Attempt,
    prior: Option<&Prior>,
    mut seek: impl FnMut(Option<&Prior>) -> Attempt,
) -> Attempt {
    let Some(prior) = prior.filter(|_| nothing(&first.outcome)) else { return first };
    wider(prior).iter().map(|prior| seek(prior.as_ref())).find(|attempt| !nothing(&attempt.outcome)).unwrap_or(first)
}

/// Whether the object was not found in the gates.
///
/// An exhausted budget and a degenerate pose do not show that.
fn nothing(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::Fix(_) | Outcome::Ambiguous(_) | Outcome::Degenerate(_) => false,
        Outcome::Rejected(rejection) => match rejection {
            RejectionReason::Search(why) => !matches!(why, Rejected::Budget { .. } | Rejected::TooLarge { .. }),
            RejectionReason::TooFew { .. }
            | RejectionReason::Absent { .. }
            | RejectionReason::Residuals { .. }
            | RejectionReason::Behind { .. }
            | RejectionReason::Prior { .. } => true,
            RejectionReason::Imprecise { .. }
            | RejectionReason::InfluentialPairs { .. }
            | RejectionReason::Attitude { .. }
            | RejectionReason::ScaleError { .. }
            | RejectionReason::DepthError { .. }
            | RejectionReason::Inconsistent { .. } => false,
        },
    }
}
