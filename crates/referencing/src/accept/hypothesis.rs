//! A set of pairs with the pose it leads to.

use seafix_geometry::{Camera, Covariance6, Object, Transform};

use super::{Alternative, RejectionReason};
use crate::{Correspondence, Degenerate, solve::likelihood::Likelihood};

/// A set with its pose.
#[derive(Clone)]
pub(super) struct Hypothesis {
    pub(super) pairs: Vec<Correspondence>,
    /// What the solver says.
    pub(super) pose: Transform<Object, Camera>,
    /// The most likely pose near it, and how well that explains the pairs.
    pub(super) likelihood: Likelihood,
    /// As [`Alternative::score`].
    pub(super) score: f64,
    /// The covariance of `pose`, once it was asked for.
    pub(super) covariance: Option<Covariance6<Object, Camera>>,
    /// Other poses of the same pairs that are as likely, the likeliest first ([`Solver::alternatives`](crate::Solver::alternatives)): with
    /// one the pose is ambiguous.
    pub(super) alternatives: Vec<Alternative>,
}

impl Hypothesis {
    pub(super) fn alternative(self) -> Alternative {
        Alternative { object_from_camera: self.pose, pairs: self.pairs, score: self.score }
    }
}

/// The likeliest first; of equals the first in the order of the pairs.
pub(super) fn by_score(a: &Hypothesis, b: &Hypothesis) -> std::cmp::Ordering {
    b.score.total_cmp(&a.score).then_with(|| a.pairs.cmp(&b.pairs))
}

/// Why a hypothesis falls.
pub(super) enum Fallen {
    Refused(RejectionReason),
    Degenerate(Degenerate),
}
