//! When nothing is found: shells that grow, then vanish.

use super::{Attempt, Outcome, RejectionReason};
use crate::{Prior, PriorBound, Rejected};

/// By how much the shells grow, in turn, before they vanish.
const GROWTH: [f64; 2] = [2.0, 4.0];

/// The priors to seek from in turn where an object may have been displaced: the same with shells twice and four times as
/// large, then none.
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

/// An attempt from one prior after the other, until one finds something: a pose, or several between which the data do
/// not decide. Where none does, the refusal is that of the first.
///
/// A wider prior says less, so that its poses need more evidence; and every further look is one more chance to be wrong.
pub fn search_with_expanding_gates(
    first: Attempt,
    prior: Option<&Prior>,
    mut seek: impl FnMut(Option<&Prior>) -> Attempt,
) -> Attempt {
    let Some(prior) = prior.filter(|_| nothing(&first.outcome)) else { return first };
    wider(prior).iter().map(|prior| seek(prior.as_ref())).find(|attempt| !nothing(&attempt.outcome)).unwrap_or(first)
}

/// Whether the object was not found where it was sought. What ended at a budget or cannot be a pose says nothing of that.
fn nothing(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::Fix(_) | Outcome::Ambiguous(_) | Outcome::Degenerate(_) => false,
        Outcome::Rejected(refusal) => match refusal {
            RejectionReason::Search(why) => !matches!(why, Rejected::Budget { .. } | Rejected::TooLarge { .. }),
            RejectionReason::TooFew { .. }
            | RejectionReason::AContrario { .. }
            | RejectionReason::Absent { .. }
            | RejectionReason::Residuals { .. }
            | RejectionReason::Behind { .. }
            | RejectionReason::Prior { .. } => true,
            RejectionReason::Imprecise { .. }
            | RejectionReason::Hinge { .. }
            | RejectionReason::Attitude { .. }
            | RejectionReason::Stretched { .. } => false,
        },
    }
}
