//! Searches, and the result of one.

use rand::Rng;
use seafix_component::counted;

use crate::{
    problem::{Correspondence, Problem},
    search::posterior::Posterior,
};

/// A search for correspondences between model points and cloud points (data association).
///
/// Most searches have a setting `budget`: the maximum number of pair tests, without those that build the graph.
/// `rigid-consensus` counts the words that it reads of its graph. A search that spends its budget returns the best set so far, with `optimal` false and
/// `undecided` set to [`Rejected::Budget`]. It returns [`Rejected::Budget`] as the error if no three pairs were found
/// to agree.
///
/// A minimal search takes the first coherent candidate of each model point. It shows the interface; it does not meet
/// the laws of a search:
///
/// ```
/// use rand::{Rng, SeedableRng};
/// use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};
/// use seafix_referencing::{
///     Candidates, Correspondence, Identification, ModelPoint, Problem, Rejected, Search, Tolerance,
/// };
///
/// #[derive(Debug)]
/// struct Greedy;
///
/// impl Search for Greedy {
///     fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
///         let mut pairs: Vec<Correspondence> = Vec::new();
///         for (model, list) in problem.candidates.lists.iter().enumerate() {
///             let candidate = |&cloud: &usize| Correspondence { model, cloud };
///             let coherent = |pair: &Correspondence| pairs.iter().all(|other| problem.coherent(*pair, *other));
///             pairs.extend(list.iter().map(candidate).find(coherent));
///         }
///         let bound = problem.model.len();
///         match pairs.len() {
///             0..3 => Err(Rejected::NotFound { bound, needed: 3 }),
///             _ => Ok(Identification::unproved(pairs, bound, 0)),
///         }
///     }
/// }
///
/// // Three corners of a box, 3 m in front of the camera.
/// let corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.4, 0.0]];
/// let model = corners.map(|at| ModelPoint::exact("", Point::from(at)));
/// let cloud = corners.map(|[x, y, z]| MeasuredPoint {
///     position: UncertainPoint::isotropic(Point::from([x, y, z + 3.0]), 0.01),
///     pixels: None,
/// });
/// let candidates = Candidates::from_pairs(3, (0..3).flat_map(|i| (0..3).map(move |j| (i, j))));
/// let tolerance = Tolerance::Fixed(0.02);
/// let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None, edges: Default::default() };
/// let found = Greedy.search(&problem, &mut rand_chacha::ChaCha8Rng::seed_from_u64(0))?;
/// assert_eq!(found.pairs.len(), 3);
/// # Ok::<(), Rejected>(())
/// ```
pub trait Search: Send + Sync + std::fmt::Debug {
    /// Whether the search identifies edges. Others identify the points alone, as if the problem had no edges.
    fn takes_edges(&self) -> bool {
        false
    }

    /// The best set of correspondences by the measure of this search.
    ///
    /// # Errors
    /// [`Rejected`] if the data allow no answer, with the numbers that explain it.
    fn search(&self, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected>;
}

/// A coherent, one-to-one set of correspondences.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The correspondences, in the order of the model points.
    pub pairs: Vec<Correspondence>,
    /// The identified edges: model edge and measured line, in the order of the model.
    pub edges: Vec<Correspondence>,
    /// Other sets of the same size that the search found.
    pub alternatives: Vec<Vec<Correspondence>>,
    /// The edges of each alternative, in the same order; empty if no alternative has edges.
    pub alternative_edges: Vec<Vec<Correspondence>>,
    /// Whether `alternatives` holds every other set of the same size.
    pub alternatives_complete: bool,
    /// Whether the set is proved to be optimal: no admissible set is larger or, for a search by likelihood, more
    /// likely.
    pub optimal: bool,
    /// Upper bound of the number of pairs of an admissible set, of points and edges together.
    pub consensus_bound: usize,
    /// Number of pair tests, including the tests that build the graph.
    pub pair_tests: u64,
    /// If set, this set must not become a fix by itself: a larger set is a mirror image, or the search ended before it
    /// had excluded other sets of the same size. A search that looks for no alternatives leaves it `None`.
    pub undecided: Option<Rejected>,
    /// Posterior probabilities of this pose and of its alternatives; `None` for a search that counts pairs.
    pub posterior: Option<Posterior>,
}

impl Identification {
    /// A set without a proof, except that no admissible set has more than `bound` pairs.
    pub fn unproved(pairs: Vec<Correspondence>, bound: usize, pair_tests: u64) -> Self {
        Self {
            pairs,
            edges: Vec::new(),
            alternatives: Vec::new(),
            alternative_edges: Vec::new(),
            alternatives_complete: false,
            optimal: false,
            consensus_bound: bound,
            pair_tests,
            undecided: None,
            posterior: None,
        }
    }
}

/// Remedy for too few points of the object in the cloud.
pub(crate) const MORE_POINTS: &str = "bring more of the object into view, detect more features (`detector.features`), or widen the prior if there is one";
/// Remedy for too few points and edges of the object in the cloud.
const MORE_FEATURES: &str =
    "bring more of the object into view, detect more features and lines, or widen the prior if there is one";
/// Remedy for too many candidates.
pub(crate) const FEWER: &str = "give a prior pose or smaller gates, or decimate the cloud";

/// The reason why a search identified nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Rejected {
    /// Fewer than three model points have a candidate.
    #[error("too few candidates: {} with a candidate; a pose needs {needed}", counted(*.with_candidates, "model point"))]
    TooFew {
        /// Number of model points with a candidate.
        with_candidates: usize,
        /// Minimum number of model points.
        needed: usize,
    },
    /// Too few model points and edges have a candidate.
    #[error(
        "too few candidates: {} and {} with a candidate; a pose needs three",
        counted(*.points, "model point"), counted(*.edges, "edge")
    )]
    TooFewFeatures {
        /// Number of model points with a candidate.
        points: usize,
        /// Number of model edges with a candidate.
        edges: usize,
    },
    /// The largest coherent set is too small.
    #[error("no consensus: the largest coherent set has {}; {needed} are needed", counted(*.best, "feature"))]
    NoConsensus {
        /// Size of the largest set.
        best: usize,
        /// Minimum size.
        needed: usize,
    },
    /// The budget was spent before the search could answer.
    #[error(
        "search incomplete: the budget of {budget} pair tests or equivalent work is spent; best set so far {}, upper bound {bound}",
        counted(*.best, "feature")
    )]
    Budget {
        /// The budget (pair tests, or the unit that the search counts in their place).
        budget: u64,
        /// Size of the largest set found.
        best: usize,
        /// Upper bound of the size of a set.
        bound: usize,
        /// Number of pair tests, including the tests that build the graph.
        pair_tests: u64,
    },
    /// The problem exceeds the memory limit of the search, which did not start.
    #[error("too many {what}: {size}, and the search takes {max}")]
    TooLarge {
        /// Number of items.
        size: usize,
        /// The kind of items, in the plural.
        what: &'static str,
        /// Maximum number of items.
        max: usize,
        /// Upper bound of the size of a set.
        bound: usize,
    },
    /// A search without a proof found no set, or too small a set.
    #[error(
        "no pose found: the search met no set of {needed} points that one pose explains; at most {bound} are possible"
    )]
    NotFound {
        /// Upper bound of the size of a set.
        bound: usize,
        /// Minimum size.
        needed: usize,
    },
    /// A search without a proof found no set of points and edges, or too small a set.
    #[error(
        "no pose found: the search met no set of points and edges that one pose explains; at most {bound} are possible"
    )]
    NoFeaturesFound {
        /// Upper bound of the size of a set.
        bound: usize,
    },
    /// The search starts from a prior pose, and none is given.
    #[error("no prior pose: this search starts from one")]
    NoPrior,
    /// Only mirror images of the model were found.
    #[error("mirror image of the model: {} set has {best} features and is reflected", if *proved { "the largest coherent" } else { "the best known" })]
    Mirrored {
        /// Size of the mirror image.
        best: usize,
        /// Whether every coherent set of the object is proved to have at most three points.
        proved: bool,
    },
}

impl Rejected {
    /// Whether absence is proved, in contrast to a search that only found nothing.
    pub fn is_proved(&self) -> bool {
        matches!(
            self,
            Self::TooFew { .. }
                | Self::TooFewFeatures { .. }
                | Self::NoConsensus { .. }
                | Self::Mirrored { proved: true, .. }
        )
    }

    /// The remedy in one phrase.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFew { .. } | Self::NoConsensus { .. } | Self::NotFound { .. } => MORE_POINTS,
            Self::TooFewFeatures { .. } | Self::NoFeaturesFound { .. } => MORE_FEATURES,
            Self::NoPrior => "give a prior pose or another search",
            Self::Budget { .. } => "narrow the prior or raise the budget of the search (`search.budget`)",
            Self::TooLarge { .. } => FEWER,
            Self::Mirrored { .. } => "check the axes of the object model and the order of the images",
        }
    }

    /// The reason in logs and tables, in kebab-case.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::TooFew { .. } | Self::TooFewFeatures { .. } => "too-few",
            Self::NoConsensus { .. } => "no-consensus",
            Self::NoPrior => "no-prior",
            Self::NotFound { .. } | Self::NoFeaturesFound { .. } => "not-found",
            Self::Budget { .. } => "budget",
            Self::TooLarge { .. } => "too-large",
            Self::Mirrored { .. } => "mirrored",
        }
    }
}
