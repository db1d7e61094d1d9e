//! What came of one attempt to fix one target in one frame.

use std::{fmt, str::FromStr};

use super::{
    line::EdgePair,
    matrix::{Matrix4, Matrix6},
    mirror::mirror,
};

/// One row of the results: a frame, a target, and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetRecord {
    /// Id of the target; empty in the row of a frame that attempted none.
    pub object: String,
    /// Name of the search.
    pub search: String,
    /// Name of the solver.
    pub solver: String,
    /// The outcome.
    pub outcome: Outcome,
    /// The reason of an outcome without a fix, in one word (`too-few`, `absent`, `budget`, …); empty of a fix.
    pub reason: String,
    /// Why not, in a sentence with numbers; where a joint fix was asked for, what took part in it, what did not and why,
    /// or why there is none. Empty of any other fix.
    pub explanation: String,
    /// The estimated pose of a fix.
    pub object_from_camera: Option<Matrix4>,
    /// Its covariance, of ξ in `T_true = T_est · Exp(ξ)`, camera frame, rotation first.
    pub covariance: Option<Matrix6>,
    /// For each point of the target, the indices of the cloud points that might be it.
    pub candidates: Vec<Vec<u32>>,
    /// The identified points.
    pub pairs: Vec<Pair>,
    /// The identified edges.
    pub edges: Vec<EdgePair>,
    /// Indices into `pairs` of the points that the solver used.
    pub used: Vec<u32>,
    /// Other poses that explain the data.
    pub alternatives: Vec<Alternative>,
    /// Whether the search proved that no larger set exists.
    pub optimal: Option<bool>,
    /// No admissible set has more pairs than this.
    pub consensus_bound: Option<u64>,
    /// Expected number of chance sets at least as large as the one found.
    pub nfa: Option<f64>,
    /// Probability that the object is absent; `None` for labelled points.
    pub p_absent: Option<f64>,
    /// Probability that the pose of the fix, or of `best`, is not the object's.
    pub p_wrong: Option<f64>,
    /// The best pose of an answer that is no fix.
    pub best: Option<BestPose>,
    /// Pair tests that the search spent.
    pub pair_tests: Option<u64>,
    /// Root mean square of C·H − P over the pairs (m).
    pub residual_rms: Option<f64>,
    /// What supports a fix beyond its covariance.
    pub integrity: Option<Integrity>,
    /// How it compares with truth.
    pub evaluation: Evaluation,
    /// Times of the stages that serve this target alone.
    pub times: TargetTimes,
}

impl TargetRecord {
    /// The row of `object`, attempted with this search and solver, rejected for `reason`, with all that
    /// is unknown left empty.
    pub fn rejected(object: &str, search: &str, solver: &str, reason: &str) -> Self {
        Self {
            object: object.to_owned(),
            search: search.to_owned(),
            solver: solver.to_owned(),
            outcome: Outcome::Rejected,
            reason: reason.to_owned(),
            explanation: String::new(),
            object_from_camera: None,
            covariance: None,
            candidates: Vec::new(),
            pairs: Vec::new(),
            edges: Vec::new(),
            used: Vec::new(),
            alternatives: Vec::new(),
            optimal: None,
            consensus_bound: None,
            nfa: None,
            p_absent: None,
            p_wrong: None,
            best: None,
            pair_tests: None,
            residual_rms: None,
            integrity: None,
            evaluation: Evaluation::default(),
            times: TargetTimes::default(),
        }
    }

    /// The row of a frame that attempted no target, for `reason` (`no-data`, `nothing-in-view`).
    pub fn not_attempted(search: &str, solver: &str, reason: &str) -> Self {
        Self::rejected("", search, solver, reason)
    }

    /// Whether this row is an attempt at a target.
    pub fn attempted(&self) -> bool {
        !self.object.is_empty()
    }
}

/// What came of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Outcome {
    /// A pose that passed every test.
    Fix,
    /// Several poses explain the data equally well.
    Ambiguous,
    /// No set of points was identified, or the set was not believed.
    Rejected,
    /// The identified points determine no pose.
    Degenerate,
}

impl Outcome {
    /// All outcomes.
    pub const ALL: [Self; 4] = [Self::Fix, Self::Ambiguous, Self::Rejected, Self::Degenerate];

    /// The word for it in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fix => "fix",
            Self::Ambiguous => "ambiguous",
            Self::Rejected => "rejected",
            Self::Degenerate => "degenerate",
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Outcome {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|outcome| outcome.name() == word)
            .ok_or_else(|| format!("no outcome is called `{word}`; there are {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// A point of the target and the cloud point believed to be it, by their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pair {
    /// Index into the target's points.
    pub model: u32,
    /// Index into the frame's cloud.
    pub cloud: u32,
}

/// Another pose that explains the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub object_from_camera: Matrix4,
    /// Its pairs.
    pub pairs: Vec<Pair>,
    /// How well it explains the data; larger is better.
    pub score: f64,
}

/// The best pose of an answer that is no fix.
#[derive(Debug, Clone, PartialEq)]
pub struct BestPose {
    /// The pose.
    pub object_from_camera: Matrix4,
    /// Its covariance, as that of a fix; `None` if the pairs determine none.
    pub covariance: Option<Matrix6>,
    /// Its pairs.
    pub pairs: Vec<Pair>,
}

mirror! {
    /// What supports a fix beyond its covariance.
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct Integrity {
        /// `unmonitored` (three points), `detectable` (four), `excludable` (five and more).
        pub redundancy: String,
        /// χ² of the residuals at the most likely pose.
        pub chi2: f64,
        /// Its degrees of freedom.
        pub dof: u64,
        /// What it exceeds with one minus the confidence.
        pub chi2_limit: f64,
        /// How far the position moves at most (m) when one point is left out.
        pub solution_separation: Option<f64>,
        /// The same when two are.
        pub solution_separation_two: Option<f64>,
        /// The protection level of the position (m).
        pub protection_position: Option<f64>,
        /// That of the attitude (rad).
        pub protection_attitude: Option<f64>,
        /// By how much measured distances are longer than the model's, as a share of them.
        pub scale_error: Option<f64>,
        /// Its standard deviation.
        pub scale_error_sigma: Option<f64>,
        /// By how much measured distances along the optical axis are longer than the model's, as a fraction of them.
        pub depth_error: Option<f64>,
        /// Its standard deviation.
        pub depth_error_sigma: Option<f64>,
    }
}

mirror! {
    /// How an attempt compares with truth; `None` where truth or a pose is missing.
    #[derive(Debug, Clone, Copy, PartialEq, Default)]
    pub struct Evaluation {
        /// Whether this is a fix whose target registration error (TRE) exceeds the alert limit.
        pub wrong: Option<bool>,
        /// A false pair was used.
        pub wrong_pairs: Option<bool>,
        /// Points of the target that both cameras really see.
        pub visible: Option<u32>,
        /// Pairs that were identified.
        pub identified: Option<u32>,
        /// Pairs whose cloud point lies within 2 px of the true projections, in both images.
        pub correct_pairs: Option<u32>,
        /// The fit RMS (m): the residual C·H − P over the correctly identified pairs.
        pub fit_rms: Option<f64>,
        /// The fit RMS (m) without the points that the solver used.
        pub fit_rms_unused: Option<f64>,
        /// The TRE (m): the RMS error of all model points that the pose transfers.
        pub tre_rms: Option<f64>,
        /// The error of the left camera's position in the object frame (m).
        pub position_error: Option<f64>,
        /// The error of its attitude (rad).
        pub attitude_error: Option<f64>,
        /// Normalised estimation error squared, six degrees of freedom.
        pub nees: Option<f64>,
        /// The Cramér–Rao bound of the TRE (m), where it is known.
        pub tre_crlb: Option<f64>,
        /// The Cramér–Rao bound on the position (m), where it is known.
        pub position_crlb: Option<f64>,
        /// The alert limit (m): a TRE beyond it is wrong, a protection level beyond it leaves the fix unavailable. `None` in logs
        /// that are older than it, whose header has those of the targets.
        pub alert_limit: Option<f64>,
        /// The number of edges of the target that face the camera and lie in both images; `None` for a target without
        /// edges.
        pub edges_visible: Option<u32>,
        /// The number of identified edges; `None` for a target without edges.
        pub edges_identified: Option<u32>,
        /// The number of identified edges whose line lies within 2 px of the true one at both ends, in both images.
        pub correct_edges: Option<u32>,
        /// The maximum symmetry-aware surface distance of BOP (m).
        pub mssd: Option<f64>,
        /// The maximum symmetry-aware projection distance of BOP in the left image (px).
        pub mspd: Option<f64>,
    }
}

/// Times of the stages that serve one target (ms); `None` where a stage did not run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TargetTimes {
    /// Choosing candidates.
    pub candidates_ms: Option<f64>,
    /// Search.
    pub search_ms: Option<f64>,
    /// Solve.
    pub solve_ms: Option<f64>,
    /// From the images to this target's answer.
    pub total_ms: Option<f64>,
}
