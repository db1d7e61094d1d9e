//! Greedy growth of an admissible set from ranked pairs, the last step of every strategy that ranks.

use seafix_geometry::{Camera, Object, Transform};

use super::{
    association::vertices,
    clique::{MAX_ORIENTED, decisive_members},
    identification::{Identification, Rejected},
    limits::NEEDED,
    orientation::{Sense, unmirrored, wholly_mirrored},
    pose::fraction,
    quadruples::Quadruples,
    volumes::Volumes,
};
use crate::problem::{Correspondence, Problem};

/// Maximum number of pairs examined for any admissible set, and number of sets begun with them.
const MAX_GROWN: usize = 2048;
const BEGINNINGS: usize = 16;

/// Maximum number of quadruples tested for a set that is too large for all of them.
const MAX_QUADRUPLES: u64 = 1_000_000;

/// The admissible set that grows from ranked pairs, in the order added.
///
/// Each pair in turn joins if it is coherent with all pairs of the set and forms no rejected quadruple with three of
/// them.
pub(super) fn grow(
    problem: &Problem<'_>,
    ranked: &[Correspondence],
    sense: Sense,
    pair_tests: &mut u64,
) -> Vec<Correspondence> {
    let volumes = Volumes::of(problem, ranked);
    let (mut taken, mut quadruples) = (Vec::new(), Quadruples::default());
    for next in 0..ranked.len() {
        if admits(&volumes, &mut quadruples, sense, &taken, next, pair_tests) {
            taken.push(next);
        }
    }
    taken.into_iter().map(|place| ranked[place]).collect()
}

/// Whether a vertex is coherent with every member and forms no rejected quadruple with three of them.
pub(super) fn admits(
    volumes: &Volumes<'_>,
    quadruples: &mut Quadruples,
    sense: Sense,
    taken: &[usize],
    next: usize,
    pair_tests: &mut u64,
) -> bool {
    for &other in taken {
        *pair_tests += 1;
        if !volumes.coherent(other, next) {
            return false;
        }
    }
    if sense == Sense::Any {
        return true;
    }
    let members = decisive_members(taken);
    *pair_tests += Quadruples::count(members.len());
    !quadruples.rejected(volumes, sense, members, next)
}

/// The answer of a strategy with these ranked pairs: the admissible set that grows from them.
///
/// If the same beginning grows into more pairs as a mirror image, the set is the remainder of that image: three pairs
/// are rejected, more are undecided.
///
/// # Errors
/// [`Rejected::NotFound`] with fewer than three, [`Rejected::Mirrored`].
pub(super) fn conclude(
    problem: &Problem<'_>,
    ranked: &[Correspondence],
    orientation: bool,
    mut pair_tests: u64,
) -> Result<Identification, Rejected> {
    let sense = if orientation { Sense::Proper } else { Sense::Any };
    let mut pairs = grow(problem, ranked, sense, &mut pair_tests);
    if pairs.len() < NEEDED {
        return Err(Rejected::NotFound { bound: max_possible(problem), needed: NEEDED });
    }
    let mut undecided = None;
    if orientation {
        if pairs.len() > MAX_ORIENTED {
            let kept = unmirrored(problem, pairs, MAX_QUADRUPLES);
            pair_tests += kept.pair_tests;
            pairs = kept.pairs;
        }
        let all: Vec<_> = pairs.iter().copied().chain(vertices(problem)).collect();
        let image = grow(problem, &all, Sense::Mirrored, &mut pair_tests);
        // The ranking may have stopped early: on a planar scene the object itself grows from the same pairs too.
        let larger = image.len() > pairs.len()
            && wholly_mirrored(problem, &image[..image.len().min(MAX_ORIENTED)])
            && image.len() > grow(problem, &all, sense, &mut pair_tests).len();
        if larger {
            let mirrored = Rejected::Mirrored { best: image.len(), proved: false };
            if pairs.len() <= NEEDED {
                return Err(mirrored);
            }
            undecided = Some(mirrored);
        }
    }
    pairs.sort_unstable();
    Ok(Identification { undecided, ..Identification::unproved(pairs, max_possible(problem), pair_tests) })
}

/// The answer of [`conclude`] for a search that may have ended at its budget: its set is then undecided, or missing.
///
/// # Errors
/// As [`conclude`], but [`Rejected::Budget`] alone if the budget ended.
pub(super) fn conclude_within(
    problem: &Problem<'_>,
    ranked: &[Correspondence],
    orientation: bool,
    pair_tests: u64,
    ended: Option<(u64, u64)>,
) -> Result<Identification, Rejected> {
    let concluded = conclude(problem, ranked, orientation, pair_tests);
    let Some((budget, pair_tests)) = ended else { return concluded };
    let ended = |best, bound| Rejected::Budget { budget, best, bound, pair_tests };
    match concluded {
        Ok(found) => {
            let ended = ended(found.pairs.len(), found.consensus_bound);
            Ok(Identification { undecided: found.undecided.or(Some(ended)), ..found })
        }
        Err(Rejected::NotFound { bound, .. }) => Err(ended(0, bound)),
        // The remainder of a mirror image may be all that the ranking had so far.
        Err(Rejected::Mirrored { .. }) => so_far(problem, orientation, ended(0, max_possible(problem))),
        Err(other) => Err(other),
    }
}

/// The answer of a search that spent its budget before it found three pairs: the largest admissible set that grows from
/// a few beginnings, without a proof, undecided for the given reason.
///
/// # Errors
/// The reason itself, if nothing grows.
pub(super) fn so_far(problem: &Problem<'_>, orientation: bool, why: Rejected) -> Result<Identification, Rejected> {
    let Rejected::Budget { budget, bound, mut pair_tests, .. } = why else { return Err(why) };
    let sense = if orientation { Sense::Proper } else { Sense::Any };
    let some = evenly(vertices(problem), MAX_GROWN);
    let sets = grown(&some, problem, sense, &mut pair_tests);
    let Some(pairs) = sets.into_iter().next() else { return Err(why) };
    if orientation {
        // The remainder of a mirror image is no set of the object's.
        let images = grown(&some, problem, Sense::Mirrored, &mut pair_tests);
        if images.first().is_some_and(|image| image.len() > pairs.len()) {
            return Err(why);
        }
    }
    let undecided = Some(Rejected::Budget { budget, best: pairs.len(), bound, pair_tests });
    Ok(Identification { undecided, ..Identification::unproved(pairs, bound, pair_tests) })
}

/// Admissible sets of pairs that contradict a pose, for comparison with it, the largest first.
pub(crate) fn elsewhere(problem: &Problem<'_>, pose: &Transform<Object, Camera>) -> Vec<Vec<Correspondence>> {
    let contradicts = |pair: &Correspondence| !(fraction(problem, pose, *pair) <= 1.0);
    let against: Vec<Correspondence> = vertices(problem).into_iter().filter(contradicts).collect();
    grown(&evenly(against, MAX_GROWN), problem, Sense::Proper, &mut 0)
}

/// At most `max` of the pairs, evenly decimated.
fn evenly(all: Vec<Correspondence>, max: usize) -> Vec<Correspondence> {
    let step = all.len().div_ceil(max).max(1);
    all.into_iter().step_by(step).collect()
}

/// The sets of three pairs and more that grow from a few of these, the largest first.
fn grown(of: &[Correspondence], problem: &Problem<'_>, sense: Sense, pair_tests: &mut u64) -> Vec<Vec<Correspondence>> {
    let begun = |first: Correspondence| {
        let ranked: Vec<Correspondence> = std::iter::once(first).chain(of.iter().copied()).collect();
        let mut pairs = grow(problem, &ranked, sense, pair_tests);
        pairs.sort_unstable();
        pairs
    };
    let mut sets: Vec<_> = evenly(of.to_vec(), BEGINNINGS).into_iter().map(begun).collect();
    sets.retain(|pairs| pairs.len() >= NEEDED);
    // Stable: equals remain in the order of coordinates, and the indices of points do not matter.
    sets.sort_by_key(|pairs| std::cmp::Reverse(pairs.len()));
    sets
}

/// Upper bound of the size of a set: the number of model points with candidates, and of candidates.
pub(super) fn max_possible(problem: &Problem<'_>) -> usize {
    with_candidates(&problem.candidates.lists)
}

/// [`max_possible`] for points and edges together.
pub(super) fn max_possible_features(problem: &Problem<'_>) -> usize {
    max_possible(problem) + with_candidates(problem.edges.candidates)
}

/// Upper bound of the number of one-to-one pairs of these candidates.
fn with_candidates(lists: &[Vec<usize>]) -> usize {
    let mut measured: Vec<usize> = lists.iter().flatten().copied().collect();
    measured.sort_unstable();
    measured.dedup();
    lists.iter().filter(|list| !list.is_empty()).count().min(measured.len())
}

/// Checks the preconditions of every search: three model points with candidates, and at most `max_pairs` pairs.
///
/// # Errors
/// [`Rejected::TooFew`], [`Rejected::TooLarge`].
pub(super) fn feasible(problem: &Problem<'_>, max_pairs: usize) -> Result<(), Rejected> {
    let with_candidates = problem.candidates.with_candidates();
    if with_candidates < NEEDED {
        return Err(Rejected::TooFew { with_candidates, needed: NEEDED });
    }
    let size = problem.candidates.pairs();
    if size > max_pairs {
        let bound = max_possible(problem);
        return Err(Rejected::TooLarge { size, what: "candidate pairs", max: max_pairs, bound });
    }
    Ok(())
}
