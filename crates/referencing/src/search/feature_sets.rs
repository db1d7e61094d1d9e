//! Greedy growth of admissible sets of points and edges, as `grow.rs` does for points.

use seafix_geometry::{Camera, Object, Transform};

use super::{
    clique::decisive_members,
    consensus::seeds::guided::stride,
    features::{FeatureSet, Features, enough},
    identification::{Identification, Rejected},
    limits::NEEDED,
    orientation::Sense,
    quadruples::Quadruples,
    volumes::Volumes,
};
use crate::problem::Problem;

/// Maximum number of vertices examined for sets elsewhere, and maximum number of tests of two of them.
const MAX_GROWN: usize = 2048;
const MAX_TESTS: usize = 1_000_000;
/// Maximum number of sets, the largest.
const MAX_SETS: usize = 16;
/// Maximum number of vertices by which the support of another is counted.
const COUNTED: usize = 128;

/// The admissible set that grows from ranked vertices: each in turn joins if it is coherent with all and forms no
/// rejected triple or quadruple with them.
pub(super) fn grow(features: &Features<'_>, ranked: &[usize], sense: Sense, pair_tests: &mut u64) -> Vec<usize> {
    let volumes = Volumes::of(features.problem, &features.points);
    let mut quadruples = Quadruples::default();
    let (mut taken, mut points): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
    for &next in ranked {
        *pair_tests += taken.len() as u64;
        if !taken.iter().all(|&other| features.coherent(other, next, sense)) {
            continue;
        }
        let of_points = next < features.points.len();
        if of_points && sense != Sense::Any {
            let members = decisive_members(&points);
            *pair_tests += Quadruples::count(members.len());
            if quadruples.rejected(&volumes, sense, members, next) {
                continue;
            }
        }
        if contradicts(features, &taken, next, sense, pair_tests) {
            continue;
        }
        taken.push(next);
        if of_points {
            points.push(next);
        }
    }
    taken
}

/// Whether a vertex and two members, one of the three an edge, contradict the sense.
fn contradicts(features: &Features<'_>, taken: &[usize], next: usize, sense: Sense, pair_tests: &mut u64) -> bool {
    let members = decisive_members(taken);
    members.iter().enumerate().any(|(k, &a)| {
        *pair_tests += k as u64;
        members[..k].iter().any(|&b| features.rejects([a, b, next], sense))
    })
}

/// The answer of a strategy that ranked these vertices; `ended` is the budget and the work if the search spent it.
///
/// If the same beginning grows into more features as a mirror image, the set is the remainder of that image: a set of
/// three is rejected, a larger one undecided.
///
/// # Errors
/// [`Rejected::NoFeaturesFound`] for too few features, [`Rejected::Mirrored`], [`Rejected::Budget`] if the budget ended.
pub(super) fn conclude(
    features: &Features<'_>,
    ranked: &[usize],
    orientation: bool,
    mut pair_tests: u64,
    ended: Option<(u64, u64)>,
) -> Result<Identification, Rejected> {
    let sense = if orientation { Sense::Proper } else { Sense::Any };
    let taken = grow(features, ranked, sense, &mut pair_tests);
    let bound = features.max_possible();
    let ended = |best: usize| ended.map(|(budget, pair_tests)| Rejected::Budget { budget, best, bound, pair_tests });
    let set = features.set(&taken);
    if set.len() < NEEDED || !enough(set.points.len(), set.edges.len()) {
        return Err(ended(set.len()).unwrap_or(Rejected::NoFeaturesFound { bound }));
    }
    let mut undecided = None;
    if orientation {
        let all: Vec<usize> = taken.iter().copied().chain(0..features.len()).collect();
        let image = grow(features, &all, Sense::Mirrored, &mut pair_tests).len();
        if image > taken.len() && image > grow(features, &all, sense, &mut pair_tests).len() {
            let mirrored = Rejected::Mirrored { best: image, proved: false };
            if taken.len() <= NEEDED {
                return Err(mirrored);
            }
            undecided = Some(mirrored);
        }
    }
    let undecided = undecided.or_else(|| ended(set.len()));
    let FeatureSet { points, edges } = set;
    Ok(Identification { edges, undecided, ..Identification::unproved(points, bound, pair_tests) })
}

/// Admissible sets of points and edges that contradict a pose, the largest first.
pub(crate) fn elsewhere(problem: &Problem<'_>, pose: &Transform<Object, Camera>) -> Vec<FeatureSet> {
    let features = Features::of(problem);
    let depth = |v: usize| features.edge(v).is_none_or(|edge| edge.depth);
    let against: Vec<usize> =
        (0..features.len()).filter(|&v| depth(v) && !(features.fraction(pose, v) <= 1.0)).collect();
    let evenly = |all: &[usize], max: usize| -> Vec<usize> {
        let step = all.len().div_ceil(max).max(1);
        all.iter().copied().step_by(step).collect()
    };
    let some = evenly(&against, MAX_GROWN);
    // The vertices coherent with most of those that are coherent with the first come before the others.
    let mut tests = 0;
    let mut begun = |first: usize| {
        let agrees = |v: &usize| *v != first && features.coherent(first, *v, Sense::Proper);
        let near: Vec<usize> = some.iter().copied().filter(agrees).collect();
        let sample = evenly(&near, COUNTED);
        tests += some.len() + near.len() * (sample.len() + 1);
        let support = |v: usize| sample.iter().filter(|&&w| w != v && features.coherent(v, w, Sense::Proper)).count();
        let mut ranked: Vec<(usize, usize)> = near.iter().map(|&v| (support(v), v)).collect();
        ranked.sort_by_key(|&(support, v)| (std::cmp::Reverse(support), v));
        let ranked: Vec<usize> = std::iter::once(first).chain(ranked.into_iter().map(|(_, v)| v)).collect();
        let set = features.set(&grow(&features, &ranked, Sense::Proper, &mut 0));
        (tests <= MAX_TESTS).then_some(set)
    };
    let step = stride(some.len());
    let mut sets: Vec<FeatureSet> = (0..some.len()).map_while(|k| begun(some[k * step % some.len()])).collect();
    sets.retain(|set| set.len() >= NEEDED && enough(set.points.len(), set.edges.len()));
    sets.sort_by(|a, b| b.len().cmp(&a.len()).then_with(|| (&a.points, &a.edges).cmp(&(&b.points, &b.edges))));
    sets.dedup();
    sets.truncate(MAX_SETS);
    sets
}
