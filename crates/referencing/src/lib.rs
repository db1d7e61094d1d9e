//! Pose of a stereo camera relative to a known object, from identified feature points.
//!
//! The steps follow the paper. A [`Site`] describes the known objects, and each search looks for one [`Target`]. Stage
//! 1, [`candidates()`], selects the cloud points that the prior allows for each model point. Stage 2, a [`Search`],
//! finds the largest structurally coherent set among them. A [`Solver`] computes the rigid motion. [`compute_fix()`]
//! runs search and solver, tests the result, and returns a fix or the reason for its rejection. This crate uses neither
//! images nor ground truth.

mod a_contrario;
mod accept;
mod candidates;
mod joint;
mod lanes;
mod observations;
mod parts;
mod problem;
pub mod problem_file;
mod search;
mod site;
mod solve;

pub use a_contrario::{expected_sets_as_good, nfa};
pub use accept::{
    Acceptance, Alternative, Attempt, Fix, Integrity, Outcome, Protection, Redundancy, RejectionReason, compute_fix,
    judge, judge_labelled, rms_apart, search_with_expanding_gates, wider,
};
pub use candidates::{Candidates, Gate, candidates};
pub use joint::{
    Gathered, JointFix, JointFixes, Member, ObjectObservations, Placement, RelativePose, Unadded, Unjoined, gather,
    joint_fix, joint_fixes,
};
pub use observations::{Observation, Observations};
pub use problem::{Correspondence, Prior, PriorBound, Problem, Tolerance};
pub use search::{
    Explanation, Identification, MaximumClique, Posterior, PosteriorProbabilities, Rejected, RepeatedPattern,
    RigidConsensus, SEARCHES, Samples, Search, StructuralCoherence, StructuredClutter,
};
pub use site::{BoundingBox, Congruence, Interest, ModelPoint, NoWorld, Site, SiteObject, Target, TargetKind};
pub use solve::{
    AlternativePose, Choose, Degenerate, Kabsch, Mahalanobis, SOLVERS, ScaleError, Solver, StereoReprojection, Triad,
};
