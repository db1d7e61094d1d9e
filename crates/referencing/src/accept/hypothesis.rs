//! A hypothesis: a set of pairs and its pose.

use seafix_geometry::{Camera, Covariance6, Object, Transform};

use super::rejection::RejectionReason;
use crate::{
    alternative::Alternative,
    problem::Correspondence,
    solve::{degeneracy::Degenerate, likelihood::residuals::Likelihood},
};

/// A set of pairs with its pose.
#[derive(Clone)]
pub(super) struct Hypothesis {
    pub(super) pairs: Vec<Correspondence>,
    pub(super) edges: Vec<Correspondence>,
    /// The solver's pose.
    pub(super) pose: Transform<Object, Camera>,
    /// The maximum-likelihood pose nearby, with its cost.
    pub(super) likelihood: Likelihood,
    /// The score, as [`Alternative::score`].
    pub(super) score: f64,
    /// The covariance of `pose`, once computed.
    pub(super) covariance: Option<Covariance6<Object, Camera>>,
    /// Other poses of the same pairs with a similar likelihood, the best first
    /// ([`Solver::alternatives`](crate::Solver::alternatives)); any alternative makes the pose ambiguous.
    pub(super) alternatives: Vec<Alternative>,
}

impl Hypothesis {
    /// The degrees of freedom of χ²: three for each point and four for each edge, less six.
    pub(super) fn dof(&self) -> usize {
        (3 * self.pairs.len() + 4 * self.edges.len()).saturating_sub(6)
    }
}

impl Hypothesis {
    pub(super) fn alternative(self) -> Alternative {
        Alternative { object_from_camera: self.pose, pairs: self.pairs, edges: self.edges, score: self.score }
    }
}

/// The order by falling score; equal scores are ordered by their pairs.
pub(super) fn by_score(a: &Hypothesis, b: &Hypothesis) -> std::cmp::Ordering {
    b.score.total_cmp(&a.score).then_with(|| a.pairs.cmp(&b.pairs)).then_with(|| a.edges.cmp(&b.edges))
}

/// The reason for which a hypothesis fails.
pub(super) enum Failure {
    Rejected(RejectionReason),
    Degenerate(Degenerate),
}
