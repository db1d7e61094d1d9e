//! Rigid consensus: a maximum-a-posteriori search that compares each pose with its alternatives and with absence.

mod beside;
mod context;

use std::collections::BTreeSet;

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    consensus::{
        clutter_density::ClutterDensity,
        edge_nfa::ln_nfa,
        edge_pattern::EdgePattern,
        edge_terms::EdgeTerms,
        graph::ConsistencyGraph,
        influential_pairs::{InfluentialPairs, influential_pairs},
        joined::Joined,
        likelihood::{Mode, PairTerms},
        mirror::mirror_image,
        prior_terms::PriorTerms,
        proof::{Proved, prove},
        repeated_pattern::Pattern,
        resembling,
        seeds::{Swept, guided::LARGE},
        support::IndependentPairs,
        turned::turned,
    },
    grow::{feasible, grow, max_possible_features, so_far},
    identification::{Identification, Rejected, Search},
    limits::{NEEDED, bounded},
    orientation::Sense,
    posterior::Posterior,
};
use crate::{
    a_contrario::coordinates::shuffled, ablation::SearchMechanism, problem::Problem,
    solve::likelihood::mixed::MIN_FEATURE_VALUE,
};
use beside::Beside;
use context::{Context, MAX_COMPARED, STRONG};

/// Maximum-a-posteriori pose search with Bayesian model comparison (MacKay 2003, ch. 27 and 28).
///
/// The search maximises the evidence ratio of a pose against clutter alone,
///
/// Λ = ∫ p(T) B(k) Π_i N(c_j(i) − T p_i; 0, Σ_j + σ_i² I)/ρ_i dT,
///
/// over the sets of pairs; the integral over the pose T is Laplace's approximation about the best pose of each set.
///
/// - p(T) is the prior density: a Gaussian, or a box, whose half-size counts as three standard deviations. Without a
///   prior it is uniform over all attitudes and over the bounding boxes of the cloud's parts; gaps longer than the
///   object separate the parts.
/// - ρ_i is the density of cloud points at the predicted place of model point i; without a prior it is the density of
///   the part.
/// - B(k) = k! (n − k)!/(n + 1)! is the probability of one set of k visible points if every number from 0 to n is
///   equally probable.
///
/// A pose with fewer but closer points, or nearer to the prior, can therefore outweigh a pose with more points. A pose
/// that puts a model point outside the prior's box is excluded.
///
/// # Clutter
///
/// Uniform clutter underestimates the false alarms at the edges of a box and in clumps. The best poses are therefore
/// weighed again: ρ_i becomes a mixture of uniform clutter, clutter on lines and clutter in clumps, whose fractions the
/// frame's own points determine, or the density about the predicted places of all model points if clutter is clumped
/// there. B(k) Π is summed over the subsets of the pairs, and the term of a model point
/// over all candidates near its place, since a point that fits in dense clutter may be clutter.
///
/// The posterior holds further hypotheses:
///
/// - A pattern that the object repeats continues beyond it. The evidence of a pose includes that; shifts of the object
///   within the pattern are poses of their own, with their own prior densities. A pattern like the object's may also be
///   there without the object.
/// - Poses elsewhere explain more than uniform clutter would: clutter resembles the object, which may be present
///   or absent ([`StructuredClutter`](super::StructuredClutter)).
/// - Another structure of the object's kind is there: its edges have the directions of the object's and meet as they do,
///   with other dimensions ([`Posterior::resembling`]).
/// - Putative pairs confuse points of similar appearance: the model also fits the same places in another order, and
///   each of these orders is supported by several pairs.
///
/// # Search
///
/// Best-first branch and bound over coherent triples. Three pairs give a pose, further pairs that fit it join, and the
/// pose is fitted again until the set is stable. The search reaches poses that start from three coherent pairs and
/// whose evidence is at least e⁻¹⁰ of the best and e⁻³ of absence. A triple whose distances differ much from the
/// model's fits no pose well and lowers its bound accordingly. The pruning bounds assume that the points of a set are
/// spread as the model's are on average, and that their residuals have the mean cost that noise causes, at most four
/// nats. A set that fits better may be missed if its evidence is near the threshold.
///
/// A problem of more than 256 model points with candidates begins with guided seeds: the pairs that share most
/// compatible pairs with a seed begin a set (second-order compatibility, Chen et al. 2022). Sets of interest then have
/// many members. The seeding suffices, and the enumeration need not be complete, once the probability that it has
/// missed such a set is 10⁻⁴. The seeds take at most the budget once more, in words of the graph. Such seeds also follow
/// where the enumeration of a smaller problem reaches its budget.
///
/// # Large putative sets
///
/// Of more than 256 model points with putative partners and without a prior, as key points of scans with descriptors,
/// wrong pairs come in groups and on common surfaces. Such a set is not weighed against models of clutter. Its best pose
/// is accepted by the number of its independent pairs, compared with wrong poses of the same frame
/// ([`Support`](super::Support)). The guided seeds suffice then, and a second copy is a wrong pose that leaves the best
/// without support. A mirror image refutes the pose only if nothing but chance fits the pose alone: descriptors do not
/// tell the left side of a symmetric object from the right. The errors of neighbouring pairs are alike, so that the
/// covariance counts them as one pair, and parts that look displaced enlarge it but reject no pose.
///
/// With `prove`, and if the evidence of the best pose is at least 3.8 nats, strict bounds decide which coherent sets are
/// examined. They hold for uniform clutter and to first order in the geometry. A better set joins the posterior. The
/// answer is optimal if no set remains open, unless some pairs of its pose were removed for lack of coherence.
///
/// # Cost
///
/// The graph of K candidate pairs takes O(K²). The branch and bound seldom takes more than the graph; the proof is
/// exponential in K at worst. Each has the budget as its limit, and a search that reaches it reports that. Searches
/// beside the best pose come on top: for a complete second copy as thorough as the first search, for parts of a copy up
/// to two and a half times its work, for structured clutter an eighth. In dense clutter a partly visible object beside
/// a complete copy of it may therefore be missed; [`Posterior::copies_sought`] is then false. A pose of less than nine
/// nats is a copy only if it would be accepted by itself. The tolerance and the maximum rotation of the prior prune the graph; they do not judge the pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RigidConsensus {
    /// Maximum work of the search, in graph words read (64 pairs each).
    pub budget: u64,
    /// Maximum number of candidate pairs; more are rejected, since their graph would not fit into memory (40 000 pairs
    /// take 200 MB).
    pub max_pairs: usize,
    /// Whether to prove that no set has more evidence, with the budget once more; a proved answer is `optimal`.
    pub prove: bool,
    /// Mechanisms to leave out, for ablation studies only; none by default.
    pub without: Vec<SearchMechanism>,
}

impl Default for RigidConsensus {
    fn default() -> Self {
        Self { budget: 400_000_000, max_pairs: 40_000, prove: false, without: Vec::new() }
    }
}

impl Component for RigidConsensus {
    const NAME: &'static str = "rigid-consensus";
    const VERSION: u32 = 18;
    const SUMMARY: &'static str = "the MAP pose, weighed against its alternatives and against absence";
    const SOURCE: &'static str = "own; ideas: Grimson and Lozano-Pérez, 1987; Moisan and Stival, 2004; MacKay, \
                                  Information Theory, Inference, and Learning Algorithms, 2003, ch. 27";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the evidence of a pose against clutter alone: prior, residuals, number of visible points, local clutter density",
        ),
        (
            "exact",
            "up to its pruning bounds; with `prove`, within its budget, no coherent set has more evidence under uniform clutter",
        ),
        (
            "time",
            "K²/2 pair tests for K candidate pairs, then usually as much again; at most its budget, and 2.5 times that for alternatives",
        ),
        ("features", "points and straight edges"),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)
    }
}

/// Evidence (nats) below that of absence at which a pose is not searched for.
const FLOOR: f64 = 3.0;
/// Maximum number of pairs of a large putative set that are examined for wrong matches, for the time it takes: O(k²).
const MAX_INFLUENTIAL: usize = 40;
/// Rounding error (nats) of sums in different order.
const ROUNDING: f64 = 1e-9;
impl Search for RigidConsensus {
    fn takes_edges(&self) -> bool {
        true
    }

    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let enough = |edges: usize| 2 * problem.candidates.with_candidates() + 3 * edges >= MIN_FEATURE_VALUE;
        let (edges, has_edges) = (problem.edges.with_candidates(), !problem.edges.model.is_empty());
        match feasible(problem, self.max_pairs) {
            Err(Rejected::TooFew { .. }) if enough(edges) => {}
            Err(Rejected::TooFew { with_candidates: points, .. }) if has_edges => {
                return Err(Rejected::TooFewFeatures { points, edges });
            }
            other => other?,
        }
        let bound = max_possible_features(problem);
        let nothing = match has_edges {
            true => Rejected::NoFeaturesFound { bound },
            false => Rejected::NotFound { bound, needed: NEEDED },
        };
        let Some(prior_terms) = PriorTerms::of(problem) else { return Err(nothing) };
        let graph = ConsistencyGraph::of(problem, &prior_terms);
        let terms = PairTerms::of(problem, &prior_terms, &graph);
        // A large putative set is judged by its independent pairs.
        let large = self.with(SearchMechanism::IndependentPairs)
            && problem.edges.with_candidates() == 0
            && shuffled(problem)
            && graph.starts.len() > LARGE;
        let context = Context {
            problem,
            parts: (&terms, &prior_terms, &graph),
            edges: EdgeTerms::of(problem, &prior_terms),
            by_points: enough(0),
            none: BTreeSet::new(),
            without: &self.without,
        };
        let (mut swept, proved) = self.enumerate(&context, large);
        let proof_tests = proved.as_ref().map_or(0, |proved| proved.pair_tests);
        let mut clutter_density = ClutterDensity::without(&self.without);
        let pattern = if large { None } else { pattern_of(&context, &swept) };
        let edge_pattern = if pattern.is_some() { None } else { edge_pattern_of(&context, &swept) };
        add_shifted_and_turned(&context, pattern.as_ref(), &mut swept);
        swept.modes.truncate(MAX_COMPARED);
        add_shifted_along(&context, edge_pattern.as_ref(), &mut swept);
        if !large {
            context.weigh(&mut clutter_density, &mut swept, &[]);
        }
        if let (Some(pattern), Some(edges)) = (&edge_pattern, &context.edges) {
            pattern.weigh(edges, &mut swept.modes);
        }
        let continued = pattern
            .as_ref()
            .and_then(|pattern| pattern.weigh(problem, context.parts, context.edges.as_ref(), &mut swept.modes));
        let mut pair_tests = graph.pair_tests + swept.pair_tests + proof_tests;
        let ended = |best: usize, pair_tests| Rejected::Budget { budget: self.budget, best, bound, pair_tests };
        let Some(best) = swept.modes.first() else {
            return if swept.complete { Err(nothing) } else { so_far(problem, true, ended(0, pair_tests)) };
        };
        // Neighbouring pairs of a large set have common errors: the places that the pose explains alone decide.
        let independent = large.then(|| IndependentPairs::of(context.parts));
        let refutes = |image: &Mode| independent.as_ref().is_none_or(|of| of.explains(&image.motion, &best.motion));
        // Two edges and more have a sense of their own.
        if self.with(SearchMechanism::Mirror)
            && best.edges.len() < 2
            && let Some(image) = mirror_image(problem.model, context.parts, best).filter(refutes)
        {
            return Err(Rejected::Mirrored { best: image.members.len(), proved: false });
        }
        let beside = match best.ln_evidence >= STRONG && !large {
            true => Beside::of(&context, &swept, pattern.as_ref(), self.budget, &mut clutter_density),
            false => Beside::none(),
        };
        pair_tests += beside.pair_tests;
        let complete = swept.complete && beside.copies.complete;
        let gap = |proved: Proved| Some(proved.bound - best.ln_uniform).filter(|gap| *gap > ROUNDING).unwrap_or(0.0);
        let evidence_gap = proved.map(gap);
        // The returned set is coherent throughout: among twenty true points some two usually differ by more than the
        // tolerance, and the worst fitting are dropped. The posterior keeps them.
        let mut pairs = grow(problem, &best.closest_first(&terms, &graph), Sense::Proper, &mut pair_tests);
        let identified = context.edge_pairs(best);
        if 2 * pairs.len() + 3 * identified.len() < MIN_FEATURE_VALUE {
            let size = pairs.len() + identified.len();
            return if complete { Err(nothing) } else { so_far(problem, true, ended(size, pair_tests)) };
        }
        pairs.sort_unstable();
        let (ln_nfa, resembling) = of_its_kind(&context, best);
        let explain = |modes: &[Mode]| modes.iter().map(|mode| context.explanation(mode)).collect::<Vec<_>>();
        Ok(Identification {
            undecided: (!complete).then(|| ended(pairs.len() + identified.len(), pair_tests)),
            edges: identified,
            alternatives: Vec::new(),
            alternative_edges: Vec::new(),
            alternatives_complete: false,
            // A proof for the pose does not hold for the rest of its pairs after some were dropped.
            optimal: evidence_gap == Some(0.0) && pairs.len() == best.members.len() && best.edges.is_empty(),
            consensus_bound: bound,
            pair_tests,
            posterior: Some(Posterior {
                explanations: [explain(&swept.modes), explain(&beside.missed)].concat(),
                beside: explain(&beside.copies.modes),
                copies_sought: beside.copies_sought,
                pattern_alone: continued.map(|continued| continued.alone),
                pattern_shifted: continued.map(|continued| continued.shifted),
                structured_clutter: beside.structured_clutter,
                unlikely: beside.unlikely.as_ref().map(|mode| context.explanation(mode)),
                evidence_gap,
                ln_nfa,
                resembling,
                support: independent.and_then(|of| of.support(&swept.modes)),
                influential_pairs: influential_pairs_of(&context, best, (!large).then_some(&mut clutter_density)),
            }),
            pairs,
        })
    }
}

impl RigidConsensus {
    fn with(&self, mechanism: SearchMechanism) -> bool {
        !self.without.contains(&mechanism)
    }

    /// The poses of points and edges by their evidence under uniform clutter, and the proof, if one is wanted.
    fn enumerate(&self, context: &Context<'_>, large: bool) -> (Swept, Option<Proved>) {
        let seeds = context.seeds(&context.none, (NEEDED, -FLOOR), self.budget);
        let mut swept = match context.by_points {
            // The proof starts from the complete enumeration.
            true => if self.prove { seeds } else { seeds.guided(self.budget).sampled(large) }.sweep(),
            false => Swept::nothing(),
        };
        // A pose that cannot be accepted needs no proof.
        let proved = match self.prove && strong(&swept) {
            true => prove(context.problem.model, context.parts, &mut swept, self.budget),
            false => None,
        };
        // Frees up to a hundred megabytes that are no longer needed.
        swept.pairs = Vec::new();
        context.add_edges([&context.none, &context.none], &mut swept);
        (swept, proved)
    }
}

/// Whether the best pose may be accepted.
fn strong(swept: &Swept) -> bool {
    swept.modes.first().is_some_and(|best| best.ln_evidence >= STRONG)
}

/// The pattern that the model repeats, if the best pose is one of points and may be accepted.
fn pattern_of(context: &Context<'_>, swept: &Swept) -> Option<Pattern> {
    let of_points = swept.modes.first().is_some_and(|best| best.members.len() >= NEEDED);
    let wanted = context.with(SearchMechanism::Pattern) && strong(swept) && of_points;
    wanted.then(|| Pattern::of(context.problem.model, context.problem.edges.model)).flatten()
}

/// The pattern that the model's edges repeat, if the best pose has edges and may be accepted.
fn edge_pattern_of(context: &Context<'_>, swept: &Swept) -> Option<EdgePattern> {
    let of_edges = swept.modes.first().is_some_and(|best| !best.edges.is_empty());
    let wanted = context.with(SearchMechanism::Pattern) && strong(swept) && of_edges;
    context.edges.as_ref().filter(|_| wanted).and_then(EdgePattern::of)
}

/// Adds the poses that the best one becomes when the object is shifted within its pattern, or turned about its edges.
fn add_shifted_and_turned(context: &Context<'_>, pattern: Option<&Pattern>, swept: &mut Swept) {
    let climb = context.climb();
    if context.with(SearchMechanism::PatternShifts)
        && let (Some(pattern), Some(best)) = (pattern, swept.modes.first())
    {
        let shifts = pattern.shifts(context.problem, &climb, context.edges.as_ref(), best);
        swept.insert(shifts);
    }
    if let (Some(edges), Some(best)) = (&context.edges, swept.modes.first().filter(|best| !best.edges.is_empty())) {
        let turned = turned(&Joined { climb: &climb, edges, taken: &context.none }, best);
        swept.insert(turned);
    }
}

/// Adds the poses along the pattern of the object's edges, which may have much less evidence of their own than the best.
fn add_shifted_along(context: &Context<'_>, pattern: Option<&EdgePattern>, swept: &mut Swept) {
    let pattern = pattern.filter(|_| context.with(SearchMechanism::PatternShifts));
    if let (Some(pattern), Some(edges), Some(best)) = (pattern, &context.edges, swept.modes.first()) {
        let climb = context.climb();
        let shifts = pattern.shifts(&Joined { climb: &climb, edges, taken: &context.none }, best);
        swept.insert(shifts);
    }
}

/// The pairs of the best pose that may be clutter, if their number can be examined.
fn influential_pairs_of(
    context: &Context<'_>,
    best: &Mode,
    density: Option<&mut ClutterDensity>,
) -> Vec<InfluentialPairs> {
    let large = density.is_none();
    let few = best.members.len() > NEEDED && (!large || best.members.len() <= MAX_INFLUENTIAL);
    match few && best.edges.is_empty() && (large || best.ln_evidence >= STRONG) {
        true => influential_pairs(context.problem, context.parts, density, best),
        false => Vec::new(),
    }
}

/// Of a pose with edges: the ln number of false alarms, and the ln evidence of another structure of the object's kind.
fn of_its_kind(context: &Context<'_>, best: &Mode) -> (Option<f64>, Option<f64>) {
    let Some(edges) = context.edges.as_ref().filter(|_| !best.edges.is_empty()) else { return (None, None) };
    let climb = context.climb();
    let joined = Joined { climb: &climb, edges, taken: &context.none };
    let wanted = context.with(SearchMechanism::Resembling) && best.ln_evidence >= STRONG;
    (ln_nfa(&joined, best), wanted.then(|| resembling::ln_evidence(&joined, best)).flatten())
}

#[cfg(test)]
mod tests;
