//! The result of an attempt at a fix: a fix, alternatives, or a rejection.

use std::{borrow::Cow, fmt};

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform};

use super::{integrity::Integrity, probability::Probability, rejection::RejectionReason};
use crate::{
    alternative::Alternative, problem::Correspondence, search::identification::Rejected, solve::degeneracy::Degenerate,
};

/// A fix: the camera's pose relative to the target, with covariance and integrity.
#[derive(Debug, Clone, PartialEq)]
pub struct Fix {
    /// The camera's pose in the object frame.
    pub object_from_camera: Transform<Object, Camera>,
    /// The covariance of the pose.
    pub covariance: Covariance6<Object, Camera>,
    /// The identified pairs.
    pub pairs: Vec<Correspondence>,
    /// The identified edges: model edge and measured line.
    pub edges: Vec<Correspondence>,
    /// The indices into `pairs` of the points that determine the pose: all of them, or the three of the triad.
    pub used: Vec<usize>,
    /// The residual C·H − P of each pair (m, object frame).
    pub residuals: Vec<Vector3<f64>>,
    /// The RMS of the residuals (m).
    pub residual_rms: f64,
    /// The score of the pose; larger is better.
    ///
    /// For a counting search it is −χ²/2 of residuals and prior, minus χ²₃(confidence)/2 for each pair by which
    /// the set is smaller than the largest tested one: a truncated χ², which makes sets of different sizes comparable. For a
    /// search that weighs evidence it is the log evidence (nats).
    pub score: f64,
    /// The integrity of the fix: redundancy, residual test, solution separation, protection levels.
    pub integrity: Integrity,
}

impl Fix {
    /// The standard deviation of the camera's position along one axis (m): √(tr Σ/3), the RMS over the three axes.
    ///
    /// It is the σ that an isotropic prior is given.
    pub fn position_sigma(&self) -> f64 {
        self.covariance.position_sigma()
    }

    /// The standard deviation of the camera's attitude about one axis (rad): √(tr Σ/3), the RMS over the three axes.
    pub fn attitude_sigma(&self) -> f64 {
        self.covariance.attitude_sigma()
    }

    /// The covariance (m², camera axes) of an object point as transferred by the fix.
    pub fn point_covariance(&self, point: &Point<Object>) -> Matrix3<f64> {
        self.covariance.of_point(&(self.object_from_camera.inverse() * *point))
    }

    /// The fix as one of several alternatives.
    pub(super) fn alternative(self) -> Alternative {
        Alternative {
            object_from_camera: self.object_from_camera,
            pairs: self.pairs,
            edges: self.edges,
            score: self.score,
        }
    }
}

/// The best pose of an answer that is no fix.
#[derive(Debug, Clone, PartialEq)]
pub struct BestPose {
    /// The camera's pose in the object frame.
    pub object_from_camera: Transform<Object, Camera>,
    /// The covariance of the pose; `None` if the pairs determine none.
    pub covariance: Option<Covariance6<Object, Camera>>,
    /// The pairs that support the pose.
    pub pairs: Vec<Correspondence>,
    /// The edges that support the pose.
    pub edges: Vec<Correspondence>,
}

/// The outcome of one attempt at a fix.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A pose that passed every test.
    Fix(Box<Fix>),
    /// Several poses explain the data equally well; the best is first.
    Ambiguous(Vec<Alternative>),
    /// The search returned no set, or a test rejected it.
    Rejected(RejectionReason),
    /// The identified points determine no pose.
    Degenerate(Degenerate),
}

impl Outcome {
    /// The name of the outcome in logs and tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fix(_) => "fix",
            Self::Ambiguous(_) => "ambiguous",
            Self::Rejected(_) => "rejected",
            Self::Degenerate(_) => "degenerate",
        }
    }

    /// The reason for the missing pose, in kebab-case; `None` for a fix.
    pub fn reason(&self) -> Option<&'static str> {
        match self {
            Self::Fix(_) => None,
            Self::Ambiguous(_) => Some("alternatives"),
            Self::Rejected(rejection) => Some(rejection.reason()),
            Self::Degenerate(_) => Some("degenerate"),
        }
    }

    /// The reason for the missing pose as a sentence with its numbers; `None` for a fix.
    pub fn explanation(&self) -> Option<String> {
        match self {
            Self::Fix(_) => None,
            Self::Ambiguous(alternatives) => Some(format!("{} poses fit", alternatives.len())),
            Self::Rejected(rejection) => Some(rejection.to_string()),
            Self::Degenerate(degenerate) => Some(degenerate.to_string()),
        }
    }

    /// What helps against the missing pose, in one phrase; `None` for a fix.
    pub fn remedy(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Fix(_) => None,
            Self::Ambiguous(_) => Some(Cow::Borrowed("narrow the prior")),
            Self::Rejected(rejection) => Some(rejection.remedy()),
            Self::Degenerate(degenerate) => Some(Cow::Borrowed(degenerate.remedy())),
        }
    }

    /// The reason for the missing pose with its numbers and its remedy; `None` for a fix.
    ///
    /// This is the sentence of terminals, tables, JSON and reports.
    pub fn sentence(&self) -> Option<String> {
        Some(format!("{}; {}", self.explanation()?, self.remedy()?))
    }
}

impl fmt::Display for Outcome {
    /// The outcome in one line: a fix with its precision, or the reason for its absence.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self, self.sentence()) {
            (Self::Fix(fix), _) => {
                write!(
                    f,
                    "{}: {} points{}, position ± {:.1} mm on each axis",
                    self.name(),
                    fix.pairs.len(),
                    if fix.edges.is_empty() { String::new() } else { format!(", {} edges", fix.edges.len()) },
                    1e3 * fix.position_sigma()
                )
            }
            (_, Some(sentence)) => write!(f, "{}: {sentence}", self.name()),
            (_, None) => f.write_str(self.name()),
        }
    }
}

/// An attempt at a fix: its outcome, and the search's result.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// The outcome.
    pub outcome: Outcome,
    /// The probability that the object is absent; `None` for labelled points, which need no search.
    pub p_absent: Option<f64>,
    /// The probability that the pose is not the object's: absence and other poses together.
    ///
    /// It belongs to the pose of the fix or, without one, to [`best`](Self::best). One without any pose; `None` for
    /// labelled points.
    pub p_wrong: Option<f64>,
    /// The best pose of an answer that is no fix, for a threshold of the user's own.
    ///
    /// `None` for a fix, and if the search or its pairs determine no pose.
    pub best: Option<BestPose>,
    /// The set that the search returned, accepted or rejected; empty if it returned none.
    pub identified: Vec<Correspondence>,
    /// The edges of that set.
    pub identified_edges: Vec<Correspondence>,
    /// The best pose that differs from the answer by more than the alert limit; not accepted, for comparison only.
    pub runner_up: Option<Alternative>,
    /// Whether the search proved that no admissible set is larger; a likelihood search proves that none is more
    /// probable.
    pub optimal: bool,
    /// The proved upper bound of the number of pairs of an admissible set, of points and edges together; `None` if the
    /// search states none.
    pub consensus_bound: Option<usize>,
    /// The number of false alarms (NFA) of the set; `None` if it was not computed.
    pub nfa: Option<f64>,
    /// The number of pair tests of the search; `None` if it does not count them.
    pub pair_tests: Option<u64>,
    /// Whether the search examined every possible second copy of the object, complete or partial.
    ///
    /// `None` if the search seeks no copies, or if no pose was probable enough to be accepted.
    pub copies_sought: Option<bool>,
    /// The upper bound (nats) by which an admissible set may exceed the best pose's evidence; `None` if not computed.
    ///
    /// The answer is optimal if the gap is zero and none of the best pose's pairs was excluded.
    pub evidence_gap: Option<f64>,
}

impl Attempt {
    /// The score of the answer minus the score of the runner-up.
    pub fn margin(&self) -> Option<f64> {
        match (&self.outcome, &self.runner_up) {
            (Outcome::Fix(fix), Some(other)) => Some(fix.score - other.score),
            (Outcome::Ambiguous(alternatives), _) => Some(alternatives.first()?.score - alternatives.get(1)?.score),
            _ => None,
        }
    }
}

impl Attempt {
    /// The attempt whose search rejected.
    pub(crate) fn without(why: Rejected) -> Self {
        let pair_tests = match why {
            Rejected::Budget { pair_tests, .. } => Some(pair_tests),
            _ => None,
        };
        let consensus_bound = match why {
            Rejected::Budget { bound, .. }
            | Rejected::TooLarge { bound, .. }
            | Rejected::NotFound { bound, .. }
            | Rejected::NoFeaturesFound { bound } => Some(bound),
            Rejected::NoPrior | Rejected::Mirrored { proved: false, .. } => None,
            Rejected::NoConsensus { best, .. } | Rejected::Mirrored { best, .. } => Some(best),
            Rejected::TooFew { with_candidates, .. } => Some(with_candidates),
            Rejected::TooFewFeatures { points, edges } => Some(points + edges),
        };
        Self {
            optimal: why.is_proved(),
            outcome: Outcome::Rejected(why.into()),
            p_absent: Some(Probability::NOTHING_FOUND.absent),
            p_wrong: Some(Probability::NOTHING_FOUND.wrong),
            best: None,
            identified: Vec::new(),
            identified_edges: Vec::new(),
            runner_up: None,
            consensus_bound,
            nfa: None,
            pair_tests,
            copies_sought: None,
            evidence_gap: None,
        }
    }
}
