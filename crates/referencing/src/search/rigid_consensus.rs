//! Rigid consensus: a maximum-a-posteriori search that compares each pose with its alternatives and with absence.

use std::collections::BTreeSet;

use rand::Rng;
use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    consensus::{
        clutter_density::ClutterDensity,
        edge_nfa::ln_nfa,
        edge_seeds::{edge_modes, lines_of},
        edge_terms::EdgeTerms,
        graph::ConsistencyGraph,
        hinges::hinges,
        joined::Joined,
        likelihood::{Mode, Terms},
        local_maxima::Climb,
        mirror::mirror_image,
        prior_terms::PriorTerms,
        proof::{Proved, prove},
        repeated_pattern::Pattern,
        resembling,
        seeds::{MARGIN, Seeds, Swept, guided::LARGE},
        structured_clutter::{Occupied, StructuredClutter},
        support::IndependentPairs,
        turned::turned,
    },
    grow::{feasible, grow, max_possible_features, so_far},
    identification::{Identification, Rejected, Search},
    limits::{NEEDED, bounded},
    orientation::Sense,
    posterior::{COPY, Explanation, Posterior},
};
use crate::{
    a_contrario::coordinates::shuffled, ablation::SearchMechanism, problem::Problem, solve::likelihood::mixed::ENOUGH,
};

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
///   or absent ([`StructuredClutter`]).
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
/// missed such a set is 10⁻⁴. The seeds take at most the budget once more, in words of the graph.
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
    const VERSION: u32 = 15;
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
/// Minimum evidence (nats) of a pose that may be accepted, a probability of absence of 2.2 %; only then are
/// alternatives searched for.
const STRONG: f64 = 3.8;
/// Maximum number of poses whose evidence is weighed with the local density of clutter.
const MAX_COMPARED: usize = 64;
/// Maximum number of pairs of a large putative set that are examined for wrong matches, for the time it takes: O(k²).
const MAX_HINGES: usize = 40;
/// Evidence (nats) below the best at which a pose beside it does not matter, unless it is a [`COPY`].
const BESIDE: f64 = 14.0;
/// Number of points below the best pose at which a pose is only part of a copy.
///
/// Parts of an object whose pattern continues are visible beside it anyway and are not searched for.
const LEAD: usize = 4;
/// Minimum work (words read) of the search for parts, a fraction of a millisecond.
///
/// A tenth of it is the minimum for structured clutter. Both apply even if the complete object was found at once.
const MIN_EFFORT: u64 = 50_000;
/// Rounding error (nats) of sums in different order.
const ROUNDING: f64 = 1e-9;
/// Pair tests of the graph that take as long as one word read.
const PAIRS_A_WORD: u64 = 16;

impl Search for RigidConsensus {
    fn takes_edges(&self) -> bool {
        true
    }

    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let enough = |edges: usize| 2 * problem.candidates.with_candidates() + 3 * edges >= ENOUGH;
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
        let terms = Terms::of(problem, &prior_terms, &graph);
        let parts = (&terms, &prior_terms, &graph);
        let none = BTreeSet::new();
        let seeds = Seeds::new(problem.model, parts, &none, (NEEDED, -FLOOR), self.budget);
        let with = |mechanism| !self.without.contains(&mechanism);
        // A large putative set is judged by its independent pairs.
        let large = with(SearchMechanism::IndependentPairs)
            && problem.edges.with_candidates() == 0
            && shuffled(problem)
            && graph.starts.len() > LARGE;
        // The proof starts from the complete enumeration.
        let mut swept = match enough(0) {
            true => if self.prove { seeds } else { seeds.guided(self.budget).sampled(large) }.sweep(),
            false => Swept { complete: true, parts: true, ..Swept::default() },
        };
        let mut pair_tests = graph.pair_tests + swept.pair_tests;
        let strong = |swept: &Swept| swept.modes.first().is_some_and(|best| best.ln_evidence >= STRONG);
        // A pose that cannot be accepted needs no proof.
        let proved =
            if self.prove && strong(&swept) { prove(problem.model, parts, &mut swept, self.budget) } else { None };
        pair_tests += proved.as_ref().map_or(0, |proved| proved.pair_tests);
        // Frees up to a hundred megabytes that are no longer needed.
        swept.pairs = Vec::new();
        let edge_terms = EdgeTerms::of(problem, &prior_terms);
        if let Some(edges) = &edge_terms {
            with_edges(problem, parts, edges, [&none, &none], &mut swept);
        }
        let mut clutter_density = ClutterDensity::without(&self.without);
        let mut weighted = |swept: &mut Swept| {
            for mode in &mut swept.modes {
                clutter_density.weigh(problem, parts, mode);
            }
            let by =
                |a: &Mode, b: &Mode| b.ln_evidence.total_cmp(&a.ln_evidence).then_with(|| a.members.cmp(&b.members));
            swept.modes.sort_by(by);
        };
        // The pattern is that of points.
        let by_points = swept.modes.first().is_some_and(|best| best.members.len() >= NEEDED);
        let pattern = if with(SearchMechanism::Pattern) && strong(&swept) && by_points && !large {
            Pattern::of(problem.model, problem.edges.model)
        } else {
            None
        };
        if let (true, Some(pattern), Some(best)) = (with(SearchMechanism::PatternShifts), &pattern, swept.modes.first())
        {
            let climb = Climb::new(problem.model, parts, &none);
            let shifts = pattern.shifts(problem, &climb, edge_terms.as_ref(), best);
            swept.insert(shifts);
        }
        if let (Some(edges), Some(best)) = (&edge_terms, swept.modes.first().filter(|best| !best.edges.is_empty())) {
            let climb = Climb::new(problem.model, parts, &none);
            let turned = turned(&Joined { climb: &climb, edges, taken: &none }, best);
            swept.insert(turned);
        }
        swept.modes.truncate(MAX_COMPARED);
        if !large {
            weighted(&mut swept);
        }
        let continued =
            pattern.as_ref().and_then(|pattern| pattern.weigh(problem, parts, edge_terms.as_ref(), &mut swept.modes));
        let ended = |best: usize, pair_tests| Rejected::Budget { budget: self.budget, best, bound, pair_tests };
        let Some(best) = swept.modes.first() else {
            return if swept.complete { Err(nothing) } else { so_far(problem, true, ended(0, pair_tests)) };
        };
        // Two edges and more have a sense of their own.
        let image = if with(SearchMechanism::Mirror) && best.edges.len() < 2 {
            mirror_image(problem.model, parts, best)
        } else {
            None
        };
        // Neighbouring pairs of a large set have common errors: the places that the pose explains alone decide.
        let independent = large.then(|| IndependentPairs::of(parts));
        let refutes = |image: &Mode| independent.as_ref().is_none_or(|of| of.explains(&image.motion, &best.motion));
        if let Some(image) = image.filter(refutes) {
            return Err(Rejected::Mirrored { best: image.members.len(), proved: false });
        }
        // A second copy of the object in the rest of the cloud, and a pose to compare the best with.
        let mut beside = Swept { complete: true, parts: true, ..Swept::default() };
        let mut copies_sought = None;
        let mut structured_clutter = None;
        let mut unlikely = None;
        let mut missed: Vec<Mode> = Vec::new();
        if best.ln_evidence >= STRONG && !large {
            let elsewhere = |mode: &Mode| {
                let points = mode.members.iter().filter(|&&v| best.holds(v)).count();
                let edges = mode.edges.iter().filter(|v| best.edges.binary_search(v).is_ok()).count();
                2 * points + 3 * edges < ENOUGH
            };
            let taken = best.members.iter().map(|&v| graph.vertices[v].cloud).collect();
            let min = (best.members.len() + 1).saturating_sub(LEAD).max(NEEDED);
            let left = self.budget.saturating_sub(swept.pair_tests);
            let work = swept.pair_tests + graph.pair_tests / PAIRS_A_WORD;
            let full = work.max(MIN_EFFORT);
            let by_points = enough(0);
            let copies = with(SearchMechanism::SecondCopies);
            beside = if !(by_points && copies) {
                Swept { complete: true, parts: true, ..Swept::default() }
            } else if pattern.is_some() {
                Seeds::new(problem.model, parts, &taken, (min, STRONG), left).sweep()
            } else {
                // Parts of a copy: pairs are examined for twice, and followed for half, of the time of the complete
                // search.
                let floor = (best.ln_evidence - BESIDE).clamp(0.0, COPY);
                let seeds = Seeds::new(problem.model, parts, &taken, (NEEDED, floor), left);
                seeds.with_parts(min, left.min(2 * full), left.min(full / 2)).guided(self.budget).sweep()
            };
            if let Some(edges) = edge_terms.as_ref().filter(|_| copies) {
                let lines = lines_of(best, edges);
                let floor = (best.ln_evidence - BESIDE).clamp(0.0, COPY);
                with_edges(problem, parts, edges, [&taken, &lines], &mut beside);
                // A structure of the object's kind beside the object is no second object.
                let climb = Climb::new(problem.model, parts, &none);
                let joined = Joined { climb: &climb, edges, taken: &none };
                let compared = |mode: &&mut Mode| with(SearchMechanism::Resembling) && mode.ln_evidence >= floor;
                for mode in beside.modes.iter_mut().filter(compared) {
                    mode.ln_evidence -= resembling::ln_evidence(&joined, mode).unwrap_or(0.0).max(0.0);
                }
                beside.modes.retain(|mode| mode.ln_evidence >= floor);
            }
            // Parts of an object whose pattern continues are visible anyway.
            copies_sought = Some(copies && beside.complete && beside.parts && pattern.is_none());
            // Structured clutter: poses elsewhere with at least the evidence of absence, in an eighth of that time.
            let effort = left.min((work / 8).max(MIN_EFFORT / 10));
            let structured = with(SearchMechanism::StructuredClutter);
            let mut others = match by_points && best.members.len() >= NEEDED {
                true => Seeds::new(problem.model, parts, &none, (NEEDED, 0.0), effort).contradicting(best).sweep(),
                false => Swept::default(),
            };
            pair_tests += others.pair_tests;
            weighted(&mut others);
            if best.members.len() >= NEEDED {
                let occupied = Occupied::of(problem, best, pattern.as_ref().and_then(Pattern::distinctive));
                let mistaken = with(SearchMechanism::Mislabelled)
                    .then(|| occupied.mistaken(problem, (&terms, &graph), &others.modes))
                    .flatten();
                others.modes.retain(elsewhere);
                // A shift of the object within its pattern is a hypothesis of its own.
                let is_shift = |mode: &Mode| pattern.as_ref().is_some_and(|of| of.is_shift(&best.motion, &mode.motion));
                // Poses that the pruned search missed, although they explain as much as the best.
                let known = |mode: &Mode| swept.modes.iter().any(|known| known.members == mode.members);
                let comparable = |mode: &&Mode| mode.ln_evidence >= best.ln_evidence - MARGIN;
                let comparable = others.modes.iter().filter(comparable);
                missed = comparable.filter(|mode| !known(mode)).cloned().collect();
                let clutter_patterns = others
                    .modes
                    .iter()
                    .filter(|other| structured && !is_shift(other))
                    .map(|other| occupied.structured_clutter(problem, parts, other));
                let weight = |of: &StructuredClutter| of.ln_evidence + of.ln_alone;
                structured_clutter = clutter_patterns.chain(mistaken).max_by(|a, b| weight(a).total_cmp(&weight(b)));
            }
            weighted(&mut beside);
            pair_tests += beside.pair_tests;
            unlikely = others.modes.into_iter().next();
            if unlikely.is_none()
                && best.members.len() >= NEEDED
                && swept.modes.iter().chain(&beside.modes).all(|mode| !elsewhere(mode))
            {
                unlikely = Seeds::new(problem.model, parts, &none, (NEEDED, f64::NEG_INFINITY), 0).elsewhere(best);
            }
        }
        let complete = swept.complete && beside.complete;
        let support = independent.and_then(|of| of.support(&swept.modes));
        let gap = |proved: Proved| Some(proved.bound - best.ln_even).filter(|gap| *gap > ROUNDING).unwrap_or(0.0);
        let evidence_gap = proved.map(gap);
        // The returned set is coherent throughout: among twenty true points some two usually differ by more than the
        // tolerance, and the worst fitting are dropped. The posterior keeps them.
        let mut pairs = grow(problem, &best.closest_first(&terms, &graph), Sense::Proper, &mut pair_tests);
        let identified = edge_terms.as_ref().map_or_else(Vec::new, |edges| best.edge_pairs(edges));
        if 2 * pairs.len() + 3 * identified.len() < ENOUGH {
            let size = pairs.len() + identified.len();
            return if complete { Err(nothing) } else { so_far(problem, true, ended(size, pair_tests)) };
        }
        pairs.sort_unstable();
        let explanation = |mode: &Mode| Explanation {
            pairs: mode.pairs(&graph),
            edges: edge_terms.as_ref().map_or_else(Vec::new, |edges| mode.edge_pairs(edges)),
            object_from_camera: mode.motion.transform().inverse(),
            ln_evidence: mode.ln_evidence,
            ln_clutter_density: mode.ln_clutter_density,
        };
        let few = best.members.len() > NEEDED && (!large || best.members.len() <= MAX_HINGES);
        let examined = few && best.edges.is_empty() && (large || best.ln_evidence >= STRONG);
        let density = (!large).then_some(&mut clutter_density);
        let hinges = if examined { hinges(problem, parts, density, best) } else { Vec::new() };
        let explain = |swept: &Swept| swept.modes.iter().map(explanation).collect::<Vec<_>>();
        let climb = Climb::new(problem.model, parts, &none);
        let joined = edge_terms.as_ref().filter(|_| !best.edges.is_empty());
        let joined = joined.map(|edges| Joined { climb: &climb, edges, taken: &none });
        let ln_nfa = joined.as_ref().and_then(|joined| ln_nfa(joined, best));
        let acceptable = joined.as_ref().filter(|_| with(SearchMechanism::Resembling) && best.ln_evidence >= STRONG);
        let resembling = acceptable.and_then(|joined| resembling::ln_evidence(joined, best));
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
                explanations: swept.modes.iter().chain(&missed).map(explanation).collect(),
                beside: explain(&beside),
                copies_sought,
                pattern_alone: continued.map(|continued| continued.alone),
                pattern_shifted: continued.map(|continued| continued.shifted),
                structured_clutter,
                unlikely: unlikely.as_ref().map(explanation),
                evidence_gap,
                ln_nfa,
                resembling,
                support,
                hinges,
            }),
            pairs,
        })
    }
}

/// Adds edges to the modes of points, and the modes of edges; `taken` are the cloud points and lines not to be used.
fn with_edges(
    problem: &Problem<'_>,
    (terms, prior_terms, graph): (&Terms, &PriorTerms, &ConsistencyGraph),
    edges: &EdgeTerms<'_>,
    [taken, lines]: [&BTreeSet<usize>; 2],
    swept: &mut Swept,
) {
    let climb = Climb::new(problem.model, (terms, prior_terms, graph), taken);
    let joined = Joined { climb: &climb, edges, taken: lines };
    // A mode of points alone sees none of the edges.
    swept.modes.iter_mut().for_each(|mode| {
        mode.ln_evidence += edges.ln_fraction[0];
        mode.ln_even = mode.ln_evidence;
    });
    let upgraded: Vec<Mode> = swept
        .modes
        .iter()
        .take(MAX_COMPARED)
        .filter_map(|mode| joined.near(&mode.motion, None, f64::NEG_INFINITY))
        .collect();
    let found = edge_modes(&joined, &upgraded, &mut swept.pair_tests);
    swept.insert(upgraded);
    swept.insert(found);
}

#[cfg(test)]
mod tests;
