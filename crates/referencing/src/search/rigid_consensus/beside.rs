//! Poses beside the best one: second copies of the object, structured clutter, and poses that the search missed.

use std::collections::BTreeSet;

use super::{
    super::{
        consensus::{
            clutter_density::ClutterDensity,
            edge_seeds::lines_of,
            joined::Joined,
            likelihood::Mode,
            repeated_pattern::Pattern,
            resembling,
            seeds::{MARGIN, Swept},
            structured_clutter::{ModelPlaces, StructuredClutter},
        },
        limits::NEEDED,
        posterior::COPY,
    },
    context::{Context, STRONG},
};
use crate::{ablation::SearchMechanism, solve::likelihood::mixed::MIN_FEATURE_VALUE};

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
/// Pair tests of the graph that take as long as one word read.
const PAIRS_A_WORD: u64 = 16;

/// What a cloud holds beside its best pose.
pub(super) struct Beside {
    /// Poses of the rest of the cloud: second copies of the object.
    pub(super) copies: Swept,
    /// Whether all copies and their parts were sought; `None` if the best pose cannot be accepted.
    pub(super) copies_sought: Option<bool>,
    /// Poses that the pruned search missed, although they explain as much as the best.
    pub(super) missed: Vec<Mode>,
    pub(super) structured_clutter: Option<StructuredClutter>,
    /// A pose elsewhere to compare the best with.
    pub(super) unlikely: Option<Mode>,
    /// Work done.
    pub(super) pair_tests: u64,
}

impl Beside {
    /// Nothing, because nothing was sought.
    pub(super) fn none() -> Self {
        Self {
            copies: Swept::nothing(),
            copies_sought: None,
            missed: Vec::new(),
            structured_clutter: None,
            unlikely: None,
            pair_tests: 0,
        }
    }

    /// Searches beside the first of the `swept` modes.
    pub(super) fn of(
        context: &Context<'_>,
        swept: &Swept,
        pattern: Option<&Pattern>,
        budget: u64,
        density: &mut ClutterDensity,
    ) -> Self {
        let Some(best) = swept.modes.first() else { return Self::none() };
        let effort = Effort::after(context, swept, budget);
        let mut copies = copies(context, best, pattern, &effort);
        let wanted = context.with(SearchMechanism::SecondCopies);
        // Parts of an object whose pattern continues are visible anyway.
        let copies_sought = Some(wanted && copies.complete && copies.parts && pattern.is_none());
        // Poses with at least the evidence of absence that contradict the best.
        let mut others = match context.by_points && best.members.len() >= NEEDED {
            true => context.seeds(&context.none, (NEEDED, 0.0), effort.clutter).contradicting(best).sweep(),
            false => Swept::nothing(),
        };
        context.weigh(density, &mut others, &[]);
        let (missed, structured_clutter) = match best.members.len() >= NEEDED {
            true => compared(context, (swept, best), &mut others, pattern),
            false => (Vec::new(), None),
        };
        // The best pose explains its points as the object's: about a copy of it they are no clutter.
        let of_best: Vec<usize> = cloud_points(context, best).collect();
        context.weigh(density, &mut copies, &of_best);
        let pair_tests = copies.pair_tests + others.pair_tests;
        let mut unlikely = others.modes.into_iter().next();
        if unlikely.is_none()
            && best.members.len() >= NEEDED
            && swept.modes.iter().chain(&copies.modes).all(|mode| !is_elsewhere(mode, best))
        {
            unlikely = context.seeds(&context.none, (NEEDED, f64::NEG_INFINITY), 0).elsewhere(best);
        }
        Self { copies, copies_sought, missed, structured_clutter, unlikely, pair_tests }
    }
}

/// Limits of the work beside the best pose (words read).
struct Effort {
    /// The budget, and what the search for the best pose left of it.
    budget: u64,
    left: u64,
    /// The work so far: pairs of parts of copies are examined for twice, and followed for half of it.
    first: u64,
    /// For structured clutter, an eighth of the work so far.
    clutter: u64,
}

impl Effort {
    fn after(context: &Context<'_>, swept: &Swept, budget: u64) -> Self {
        let (_, _, graph) = context.parts;
        let left = budget.saturating_sub(swept.pair_tests);
        let work = swept.pair_tests + graph.pair_tests / PAIRS_A_WORD;
        Self { budget, left, first: work.max(MIN_EFFORT), clutter: left.min((work / 8).max(MIN_EFFORT / 10)) }
    }
}

/// Whether a mode shares too few features with the best pose to be the same object.
fn is_elsewhere(mode: &Mode, best: &Mode) -> bool {
    let points = mode.members.iter().filter(|&&v| best.holds(v)).count();
    let edges = mode.edges.iter().filter(|v| best.edges.binary_search(v).is_ok()).count();
    2 * points + 3 * edges < MIN_FEATURE_VALUE
}

/// The cloud points of a mode.
fn cloud_points(context: &Context<'_>, mode: &Mode) -> impl Iterator<Item = usize> {
    let (_, _, graph) = context.parts;
    mode.members.iter().map(|&v| graph.vertices[v].cloud)
}

/// The cloud points of a mode, and those at other places of the object under it, such as a point measured twice.
fn of_object(context: &Context<'_>, best: &Mode) -> BTreeSet<usize> {
    let (terms, _, graph) = context.parts;
    let places = ModelPlaces::of(context.problem, best, None);
    let at_place = (0..graph.vertices.len()).filter(|&v| places.holds_place(context.problem, terms, graph, v));
    cloud_points(context, best).chain(at_place.map(|v| graph.vertices[v].cloud)).collect()
}

/// Second copies of the object, and with no pattern parts of them, in the rest of the cloud.
fn copies(context: &Context<'_>, best: &Mode, pattern: Option<&Pattern>, effort: &Effort) -> Swept {
    if !context.with(SearchMechanism::SecondCopies) {
        return Swept::nothing();
    }
    let taken = of_object(context, best);
    let min = (best.members.len() + 1).saturating_sub(LEAD).max(NEEDED);
    let left = effort.left;
    let mut copies = if !context.by_points {
        Swept::nothing()
    } else if pattern.is_some() {
        context.seeds(&taken, (min, STRONG), left).sweep()
    } else {
        // The bound is that of an average set: five points close together exceed it by six nats and more.
        let seeds = context.seeds(&taken, (NEEDED, 0.0), left);
        seeds.with_parts(min, left.min(2 * effort.first), left.min(effort.first / 2)).guided(effort.budget).sweep()
    };
    if let Some(edges) = &context.edges {
        let floor = (best.ln_evidence - BESIDE).clamp(0.0, COPY);
        context.add_edges([&taken, &lines_of(best, edges)], &mut copies);
        // A structure of the object's kind beside the object is no second object.
        let climb = context.climb();
        let joined = Joined { climb: &climb, edges, taken: &context.none };
        let compared = |mode: &&mut Mode| context.with(SearchMechanism::Resembling) && mode.ln_evidence >= floor;
        for mode in copies.modes.iter_mut().filter(compared) {
            mode.ln_evidence -= resembling::ln_evidence(&joined, mode).unwrap_or(0.0).max(0.0);
        }
        copies.modes.retain(|mode| mode.ln_evidence >= floor);
    }
    copies
}

/// What the poses that contradict the best one are: poses of comparable evidence, and clutter that resembles the object.
///
/// Of `others` those remain that are elsewhere.
fn compared(
    context: &Context<'_>,
    (swept, best): (&Swept, &Mode),
    others: &mut Swept,
    pattern: Option<&Pattern>,
) -> (Vec<Mode>, Option<StructuredClutter>) {
    let (terms, _, graph) = context.parts;
    let places = ModelPlaces::of(context.problem, best, pattern.and_then(Pattern::distinctive));
    let mistaken = context
        .with(SearchMechanism::Mislabelled)
        .then(|| places.mistaken(context.problem, (terms, graph), &others.modes))
        .flatten();
    others.modes.retain(|mode| is_elsewhere(mode, best));
    let known = |mode: &Mode| swept.modes.iter().any(|known| known.members == mode.members);
    let comparable = |mode: &&Mode| mode.ln_evidence >= best.ln_evidence - MARGIN && !known(mode);
    let missed = others.modes.iter().filter(comparable).cloned().collect();
    // A shift of the object within its pattern is a hypothesis of its own.
    let is_shift = |mode: &Mode| pattern.is_some_and(|of| of.is_shift(&best.motion, &mode.motion));
    let structured = context.with(SearchMechanism::StructuredClutter);
    let alike = others.modes.iter().filter(|other| structured && !is_shift(other));
    let alike = alike.map(|other| places.structured_clutter(context.problem, context.parts, other));
    let weight = |of: &StructuredClutter| of.ln_evidence + of.ln_alone;
    (missed, alike.chain(mistaken).max_by(|a, b| weight(a).total_cmp(&weight(b))))
}
