//! Pose of a stereo camera relative to a known object, from identified feature points.
//!
//! The steps follow the paper. A [`Site`] describes the known objects, and each search looks for one [`Target`]. Stage
//! 1, [`candidates()`], selects the cloud points that the prior allows for each model point. Stage 2, a [`Search`],
//! finds the best structurally coherent set among them, by its size or by the evidence of its pose. A [`Solver`] computes the rigid motion. [`compute_fix()`]
//! runs search and solver, tests the result, and returns a fix or the reason for its rejection. This crate uses neither
//! images nor ground truth.
//!
//! ```
//! use rand::SeedableRng;
//! use rand_chacha::ChaCha8Rng;
//! use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
//! use seafix_referencing::{
//!     Acceptance, Gate, Kabsch, MaximumClique, ModelPoint, Outcome, Problem, Tolerance, candidates, compute_fix,
//! };
//!
//! // The feature points of an object, and their positions in the camera frame with a standard deviation of 5 mm.
//! let model: Vec<ModelPoint> = [
//!     [0.0, 0.0, 0.0],
//!     [1.3, 0.0, 0.0],
//!     [0.3, -0.9, 0.0],
//!     [0.8, 0.6, 0.5],
//!     [-0.4, 0.7, 0.9],
//!     [0.1, -0.3, 1.2],
//!     [1.1, -0.5, 0.8],
//! ]
//! .iter()
//! .enumerate()
//! .map(|(k, at)| ModelPoint::exact(format!("P{k}"), Point::from(*at)))
//! .collect();
//! let truth = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.5, 0.1, 0.2, -3.0].into());
//! let measure = |point: &ModelPoint| UncertainPoint::isotropic(truth.inverse() * point.at, 0.005);
//! let cloud: Vec<MeasuredPoint> =
//!     model.iter().map(|point| MeasuredPoint { position: measure(point), pixels: None }).collect();
//!
//! // Stage 1; without a prior every cloud point is a candidate of every model point.
//! let candidates = candidates(&model, &cloud, None, &Gate::default(), None);
//!
//! // Stage 2, the rigid motion, and the acceptance tests.
//! let problem = Problem {
//!     model: &model,
//!     cloud: &cloud,
//!     candidates: &candidates,
//!     tolerance: Tolerance::Sigmas(4.0),
//!     prior: None,
//!     edges: Default::default(),
//! };
//! let (search, solver, acceptance) = (MaximumClique::default(), Kabsch::default(), Acceptance::default());
//! let mut rng = ChaCha8Rng::seed_from_u64(0);
//! let attempt = compute_fix(&problem, &search, &solver, &acceptance, None, &mut rng);
//! let Outcome::Fix(fix) = attempt.outcome else { panic!("{}", attempt.outcome) };
//! assert_eq!(fix.pairs.len(), 7);
//! assert!(truth.error_to(&fix.object_from_camera).norm() < 1e-6);
//! ```

mod a_contrario;
mod ablation;
mod accept;
mod alternative;
mod anchors;
mod candidates;
mod chi_square;
mod edge_candidates;
mod edge_coherence;
mod joint;
mod lanes;
mod observations;
mod parts;
mod problem;
pub mod problem_file;
mod search;
mod site;
mod solve;
mod space_line;

pub use a_contrario::{expected_sets_as_good, nfa};
pub use ablation::{AcceptanceTest, SearchMechanism};
pub use accept::{
    Acceptance, Alternative, Attempt, BestPose, Consistency, Fix, Integrity, MaxPWrong, Outcome, Protection,
    Redundancy, RejectionReason, compute_fix, judge, judge_labelled, rms_apart, search_with_expanding_gates, wider,
};
pub use candidates::{Candidates, Gate, candidates};
pub use edge_candidates::edge_candidates;
pub use joint::{
    Gathered, JointFix, JointFixes, Member, ObjectObservations, Placement, RelativePose, Unadded, Unjoined, gather,
    joint_fix, joint_fixes,
};
pub use observations::{EdgeObservation, Observation, Observations};
pub use problem::{Correspondence, Edges, Prior, PriorBound, Problem, Tolerance};
pub use search::{
    Explanation, Identification, InfluentialPairs, MaximumClique, Posterior, PosteriorProbabilities, Rejected,
    RigidConsensus, SEARCHES, Samples, Search, StructuralCoherence, StructuredClutter, Support,
};
pub use site::{
    BoundingBox, Congruence, End, Interest, ModelEdge, ModelPoint, NoWorld, Site, SiteObject, Target, TargetKind,
    site_settings,
};
pub use solve::{
    AlternativePose, Choose, Degenerate, Kabsch, Mahalanobis, SOLVERS, ScaleError, Solver, StereoReprojection, Triad,
};
pub use space_line::{LineOffset, SpaceLine};
