//! The pairs that a pose explains.

use seafix_geometry::{Camera, Object, Transform};

use super::{alike::slack, bitset::BitSet};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::{kabsch::Kabsch, solver::Solver},
};

/// The least-squares pose of some pairs; `None` if they are too few, collinear or not finite.
pub(super) fn fitted(problem: &Problem<'_>, pairs: &[Correspondence]) -> Option<Transform<Object, Camera>> {
    Kabsch::default().solve(&Observations::of(pairs, problem.model, problem.cloud, None)).ok()
}

/// The residual of a pair under a pose, as a fraction of its tolerance.
pub(crate) fn fraction(problem: &Problem<'_>, pose: &Transform<Object, Camera>, pair: Correspondence) -> f64 {
    let off = (*pose * problem.cloud[pair.cloud].position.at).distance(&problem.model[pair.model].at);
    off / slack(problem, pair)
}

/// The one-to-one pairs within tolerance of a pose, by ascending residual; among equals the first.
pub(super) fn explained(
    problem: &Problem<'_>,
    vertices: &[Correspondence],
    pose: &Transform<Object, Camera>,
) -> Vec<(f64, Correspondence)> {
    let mut near: Vec<(f64, Correspondence)> = vertices
        .iter()
        .map(|&pair| (fraction(problem, pose, pair), pair))
        .filter(|(fraction, _)| *fraction <= 1.0)
        .collect();
    near.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let (mut models, mut clouds) = (BitSet::empty(problem.model.len()), BitSet::empty(problem.cloud.len()));
    near.retain(|(_, pair)| {
        let free = !models.has(pair.model) && !clouds.has(pair.cloud);
        if free {
            models.insert(pair.model);
            clouds.insert(pair.cloud);
        }
        free
    });
    near
}

/// Alternates the fit and the choice of pairs until the score Σ (1 − fraction²) no longer grows. Returns the score and
/// the pairs.
pub(super) fn refined(
    problem: &Problem<'_>,
    vertices: &[Correspondence],
    start: Transform<Object, Camera>,
    pair_tests: &mut u64,
) -> (f64, Vec<Correspondence>) {
    const MAX_ROUNDS: usize = 10;
    let (mut best, mut pairs, mut pose) = (f64::NEG_INFINITY, Vec::new(), start);
    for _ in 0..MAX_ROUNDS {
        *pair_tests += vertices.len() as u64;
        let near = explained(problem, vertices, &pose);
        let worth: f64 = near.iter().map(|(fraction, _)| 1.0 - fraction * fraction).sum();
        if !(worth > best) {
            break;
        }
        (best, pairs) = (worth, near.into_iter().map(|(_, pair)| pair).collect());
        let Some(next) = fitted(problem, &pairs) else { break };
        pose = next;
    }
    (best, pairs)
}
