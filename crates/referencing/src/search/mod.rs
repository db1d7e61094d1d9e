//! Searches: which cloud points are which model points.

use rand::Rng;
use seafix_component::{Registry, counted, entry, in_range};

use crate::{Correspondence, Problem};

mod affinity;
mod alike;
mod association;
mod backtracking;
mod bitset;
mod clique;
mod closest;
mod complete_enumeration;
mod consensus;
mod edges;
mod gicp;
mod gnc_tls;
mod grow;
mod icp;
mod interpretation_tree;
mod joint_compatibility;
mod local;
mod maximum_clique;
mod orientation;
mod pose;
mod pose_vote;
mod posterior;
mod quadruples;
mod ransac;
mod rigid_consensus;
mod spectral;
mod structural_coherence;
mod volumes;
mod weighted_clique;

pub use consensus::{RepeatedPattern, StructuredClutter};
pub(crate) use grow::elsewhere;
pub use maximum_clique::MaximumClique;
#[cfg(test)]
pub(crate) use orientation::mirrored;
pub(crate) use pose::fraction;
pub use posterior::{Explanation, Posterior, PosteriorProbabilities};
pub use rigid_consensus::RigidConsensus;
pub use structural_coherence::{Samples, StructuralCoherence};

/// Decides which cloud points are which model points.
///
/// Every search has a budget of pair tests beyond those that build its graph (default 10⁷); past it the answer is the best
/// identification so far, not `optimal`, with [`Rejected::Budget`] as what leaves it undecided; that alone where no three
/// pairs were found to agree.
pub trait Search: Send + Sync + std::fmt::Debug {
    /// The best set of correspondences by this search's own measure.
    ///
    /// # Errors
    /// [`Rejected`]: the data allow no answer, with the numbers that say why.
    fn search(&self, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected>;
}

/// A coherent, one-to-one set of correspondences.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The set, in the order of the model points.
    pub pairs: Vec<Correspondence>,
    /// Other sets of the same size, as far as the search looks for them.
    pub alternatives: Vec<Vec<Correspondence>>,
    /// Whether `alternatives` holds every other set of the same size.
    pub alternatives_complete: bool,
    /// Whether it is proved that no admissible set is larger; of a search by likelihood, that none is likelier.
    pub optimal: bool,
    /// No admissible set has more pairs than this.
    pub consensus_bound: usize,
    /// Pair tests spent, those that built the graph included.
    pub pair_tests: u64,
    /// Why the set is not to be believed by itself: a larger set is a mirror image, or the search ended
    /// before it had seen, or ruled out, every set as large that is unlike it. `None` also of a search
    /// that looks for no rivals.
    pub undecided: Option<Rejected>,
    /// How likely this pose and others are; `None` of a search that counts.
    pub posterior: Option<Posterior>,
}

impl Identification {
    /// A set of which nothing is proved but that no admissible set has more than `bound` pairs.
    pub fn unproved(pairs: Vec<Correspondence>, bound: usize, pair_tests: u64) -> Self {
        Self {
            pairs,
            alternatives: Vec::new(),
            alternatives_complete: false,
            optimal: false,
            consensus_bound: bound,
            pair_tests,
            undecided: None,
            posterior: None,
        }
    }
}

/// What to do about too many candidates.
pub(crate) const FEWER: &str = "give a rough pose or smaller shells, or thin the cloud out";

/// Why nothing was identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Rejected {
    /// Fewer than three model points have a candidate.
    #[error("{} with a candidate; a pose needs {needed}", counted(*.with_candidates, "model point"))]
    TooFew {
        /// Model points with at least one candidate.
        with_candidates: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The largest coherent set is too small.
    #[error("the largest coherent set has {}; {needed} are needed", counted(*.best, "point"))]
    NoConsensus {
        /// Size of the largest set.
        best: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The search ended before it could answer.
    #[error(
        "the budget of {budget} pair tests, or as much other work, ended; best so far {}, at most {bound} are possible",
        counted(*.best, "point")
    )]
    Budget {
        /// The budget (pair tests, or what the search counts in place of them).
        budget: u64,
        /// Size of the largest set found.
        best: usize,
        /// No set is larger than this.
        bound: usize,
        /// Pair tests spent, those that built the graph included.
        pair_tests: u64,
    },
    /// More than the search holds in memory: it did not begin.
    #[error("{size} {what} are more than the {max} that the search takes; {}", FEWER)]
    TooLarge {
        /// How many there are.
        size: usize,
        /// What there is too much of.
        what: &'static str,
        /// How many may be.
        max: usize,
        /// No set is larger than this.
        bound: usize,
    },
    /// A search that proves nothing found too small a set, or none.
    #[error("no set of {needed} points was found that one pose explains; at most {bound} are possible")]
    NotFound {
        /// No set is larger than this.
        bound: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The search begins at a prior, and there is none.
    #[error("there is no prior, and this search begins at one")]
    NoPrior,
    /// Only mirror images of the model were found.
    #[error("{} set, {best} points, is a mirror image of the model", if *proved { "the largest coherent" } else { "the likeliest or largest known" })]
    Mirrored {
        /// Its size.
        best: usize,
        /// Whether it is proved that no coherent set of the object has more than three points.
        proved: bool,
    },
}

impl Rejected {
    /// Whether it says that there is nothing, and not only that nothing was found.
    pub fn is_proved(&self) -> bool {
        matches!(self, Self::TooFew { .. } | Self::NoConsensus { .. } | Self::Mirrored { proved: true, .. })
    }

    /// The reason as logs and tables have it, in kebab-case.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::TooFew { .. } => "too-few",
            Self::NoConsensus { .. } => "no-consensus",
            Self::NoPrior => "no-prior",
            Self::NotFound { .. } => "not-found",
            Self::Budget { .. } => "budget",
            Self::TooLarge { .. } => "too-large",
            Self::Mirrored { .. } => "mirrored",
        }
    }
}

/// All searches.
pub static SEARCHES: Registry<dyn Search> = Registry::new(
    "search",
    &[
        entry!(backtracking::Backtracking),
        entry!(complete_enumeration::CompleteEnumeration),
        entry!(gicp::Gicp),
        entry!(gnc_tls::GncTls),
        entry!(icp::Icp),
        entry!(interpretation_tree::InterpretationTree),
        entry!(joint_compatibility::JointCompatibility),
        entry!(MaximumClique),
        entry!(pose_vote::PoseVote),
        entry!(ransac::Ransac),
        entry!(RigidConsensus),
        entry!(spectral::Spectral),
        entry!(StructuralCoherence),
        entry!(weighted_clique::WeightedClique),
    ],
);

/// The default budget of a search: pair tests beyond those that build its graph.
pub(crate) const BUDGET: u64 = 10_000_000;
/// What is wrong with the two limits that most searches have.
fn bounded(budget: u64, max_pairs: usize) -> Result<(), String> {
    in_range(budget > 0, "budget", budget, "1 or more pair tests")?;
    in_range(max_pairs >= NEEDED, "max-pairs", max_pairs, "3 or more candidate pairs")
}

/// The least set that a pose can come from.
pub(crate) const NEEDED: usize = 3;
/// Sets of the largest size that are looked at before the best of them is chosen.
const MAX_TIES: usize = 4096;
