//! What comes of an attempt: a fix, rivals, or a refusal.

use std::fmt;

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform};

use super::{Integrity, RejectionReason};
use crate::{Correspondence, Degenerate, Rejected};

/// A fix: the pose relative to the target and everything that supports it.
#[derive(Debug, Clone, PartialEq)]
pub struct Fix {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Object, Camera>,
    /// The identified points.
    pub pairs: Vec<Correspondence>,
    /// The indices into `pairs` of the points the pose rests on (all of them, or the triad's three).
    pub used: Vec<usize>,
    /// The residual C·H − P of each of the pairs (m, object frame).
    pub residuals: Vec<Vector3<f64>>,
    /// Root mean square of them (m).
    pub residual_rms: f64,
    /// How well it explains the data; larger is better. Of a search that counts: minus half of the χ² of its
    /// residuals and of the prior, and χ²₃(confidence) for each pair fewer than the largest set has (a
    /// truncated χ²: sets of different size compare). Of one that weighs evidence: its logarithm (nats).
    pub score: f64,
    /// What supports it beyond its covariance.
    pub integrity: Integrity,
}

impl Fix {
    /// Standard deviation of the camera's position in the object frame (m): the root of the trace of its covariance.
    pub fn position_sigma(&self) -> f64 {
        self.covariance.position_sigma()
    }

    /// The covariance (m², camera axes) of the place where the fix puts a point of the object.
    pub fn point_covariance(&self, point: &Point<Object>) -> Matrix3<f64> {
        self.covariance.of_point(&(self.object_from_camera.inverse() * *point))
    }

    /// The same as one of several poses.
    pub(super) fn alternative(self) -> Alternative {
        Alternative { object_from_camera: self.object_from_camera, pairs: self.pairs, score: self.score }
    }
}

/// Another pose that explains the data as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its pairs.
    pub pairs: Vec<Correspondence>,
    /// How well it explains the data; larger is better. Of a search that counts: minus half of the χ² of its
    /// residuals and of the prior, and χ²₃(confidence) for each pair fewer than the largest set has (a
    /// truncated χ²: sets of different size compare). Of one that weighs evidence: its logarithm (nats).
    pub score: f64,
}

/// What came of one attempt at a fix.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A pose that passed every test.
    Fix(Box<Fix>),
    /// Several poses explain the data equally well; the likeliest first.
    Ambiguous(Vec<Alternative>),
    /// No set of points was identified, or the set was not believed.
    Rejected(RejectionReason),
    /// The identified points determine no pose.
    Degenerate(Degenerate),
}

impl Outcome {
    /// Its name in logs and tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fix(_) => "fix",
            Self::Ambiguous(_) => "ambiguous",
            Self::Rejected(_) => "rejected",
            Self::Degenerate(_) => "degenerate",
        }
    }

    /// Why there is no pose, in kebab-case; `None` where there is one.
    pub fn reason(&self) -> Option<&'static str> {
        match self {
            Self::Fix(_) => None,
            Self::Ambiguous(_) => Some("alternatives"),
            Self::Rejected(refusal) => Some(refusal.reason()),
            Self::Degenerate(_) => Some("degenerate"),
        }
    }

    /// The same in a sentence with its numbers; `None` where there is a pose.
    pub fn explanation(&self) -> Option<String> {
        match self {
            Self::Fix(_) => None,
            Self::Ambiguous(alternatives) => Some(format!("{} different poses explain the data", alternatives.len())),
            Self::Rejected(refusal) => Some(refusal.to_string()),
            Self::Degenerate(degenerate) => Some(degenerate.to_string()),
        }
    }
}

impl fmt::Display for Outcome {
    /// The outcome in one line: a fix with its precision, or why there is none.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self, self.explanation()) {
            (Self::Fix(fix), _) => {
                write!(
                    f,
                    "{}: {} points, position ± {:.1} mm",
                    self.name(),
                    fix.pairs.len(),
                    1e3 * fix.position_sigma()
                )
            }
            (_, Some(explanation)) => write!(f, "{}: {explanation}", self.name()),
            (_, None) => f.write_str(self.name()),
        }
    }
}

/// An outcome and what led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// What came of it.
    pub outcome: Outcome,
    /// The set that the search found, believed or not; empty where it found none.
    pub identified: Vec<Correspondence>,
    /// The best pose that differs from the answer by more than the alert limit, though it was not
    /// believed; for comparison only.
    pub runner_up: Option<Alternative>,
    /// Whether it is proved that no admissible set is larger; of a search by likelihood, that none is likelier.
    pub optimal: bool,
    /// No admissible set has more pairs than this, where the search says so.
    pub consensus_bound: Option<usize>,
    /// Expected number of chance sets as large as the one found.
    pub nfa: Option<f64>,
    /// Pair tests spent by the search, where it says so.
    pub pair_tests: Option<u64>,
    /// Whether the search looked at all that may lead to a second copy of the object, whole or in part, beside the answer; `None`
    /// where it looks for none, or nothing was likely enough to be believed.
    pub copies_sought: Option<bool>,
    /// No admissible set is likelier than the likeliest pose by more than this (nats); `None` where that was not asked. The answer is
    /// optimal where this is zero and none of that pose's pairs had to go.
    pub evidence_gap: Option<f64>,
}

impl Attempt {
    /// How much better than the runner-up the answer explains the data: the difference of their scores.
    pub fn margin(&self) -> Option<f64> {
        match (&self.outcome, &self.runner_up) {
            (Outcome::Fix(fix), Some(other)) => Some(fix.score - other.score),
            (Outcome::Ambiguous(alternatives), _) => Some(alternatives.first()?.score - alternatives.get(1)?.score),
            _ => None,
        }
    }
}

impl Attempt {
    /// The attempt that a search refused.
    pub(crate) fn without(why: Rejected) -> Self {
        let pair_tests = match why {
            Rejected::Budget { pair_tests, .. } => Some(pair_tests),
            _ => None,
        };
        let consensus_bound = match why {
            Rejected::Budget { bound, .. } | Rejected::TooLarge { bound, .. } | Rejected::NotFound { bound, .. } => {
                Some(bound)
            }
            Rejected::NoPrior | Rejected::Mirrored { proved: false, .. } => None,
            Rejected::NoConsensus { best, .. } | Rejected::Mirrored { best, .. } => Some(best),
            Rejected::TooFew { with_candidates, .. } => Some(with_candidates),
        };
        Self {
            optimal: why.is_proved(),
            outcome: Outcome::Rejected(why.into()),
            identified: Vec::new(),
            runner_up: None,
            consensus_bound,
            nfa: None,
            pair_tests,
            copies_sought: None,
            evidence_gap: None,
        }
    }
}
