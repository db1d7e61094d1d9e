//! The heart: which points of the cloud are the feature points of a known object, and where is the
//! camera relative to it.
//!
//! The order is the paper's. A [`Site`] tells what there is; a [`Target`] of it is looked for;
//! [`candidates`] are the cloud points that the prior allows for each model point (Stage 1); a
//! [`Search`] finds the largest structurally coherent set among them (Stage 2); a [`Solver`]
//! computes the rigid motion; [`reference()`] puts them in a row and tests the answer before it
//! believes it. This crate knows no image and no truth.

mod candidates;
mod chance;
mod joint;
mod lanes;
mod observations;
mod parts;
mod problem;
pub mod problem_file;
mod reference;
mod search;
mod site;
mod solve;

pub use candidates::{Candidates, Gate, candidates};
pub use chance::{expected_chance_sets, expected_sets_as_good};
pub use joint::{
    Gathered, Glimpse, JointFix, JointFixes, Member, Placement, RelativePose, Unadded, Unjoined, gather, joint_fix,
    joint_fixes,
};
pub use observations::{Observation, Observations};
pub use problem::{Correspondence, Prior, PriorBound, Problem, Tolerance};
pub use reference::{
    Acceptance, Alternative, Attempt, Integrity, Outcome, Protection, Redundancy, Reference, Refusal, judge,
    judge_named, reference, rms_apart, until_found, wider,
};
pub use search::{
    Belief, Explanation, Identification, Imitation, LookAlike, MaximumClique, RigidConsensus, SEARCHES, Samples,
    Search, Shares, StructuralCoherence, Unidentified,
};
pub use site::{Congruence, Interest, ModelPoint, NoWorld, Shell, Site, SiteObject, Target, TargetKind};
pub use solve::{Choose, Degenerate, Kabsch, Mahalanobis, Rival, SOLVERS, Solver, StereoReprojection, Stretch, Triad};
