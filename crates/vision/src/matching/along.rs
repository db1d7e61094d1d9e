//! Mutual nearest neighbours among admissible pairs, with the support of neighbouring pairs.

use super::{domains::Domains, nearest::Nearest, support::MatchCandidates};
use crate::detect::Keypoint;

/// The working memory of the search.
#[derive(Debug, Default)]
pub(super) struct Along {
    nearest: Nearest,
    candidates: MatchCandidates,
    pairs: Vec<(usize, usize)>,
    ambiguous: Vec<bool>,
    domains: Domains,
    decisions: Vec<Option<usize>>,
}

/// The criteria of a match.
#[derive(Debug, Clone, Copy)]
pub(super) struct Test {
    /// The maximum ratio of the squared distances to the nearest and the second nearest; 1 disables the test.
    pub(super) squared_ratio: f32,
    /// The number of neighbours that support a pair; 0: descriptors alone decide.
    pub(super) neighbours: usize,
    /// Whether ambiguous pairs of repeated patterns, possibly a period off, are kept.
    pub(super) patterns: bool,
}

impl Along {
    /// Calls `accept` with the mutual nearest neighbours that pass the ratio test.
    ///
    /// Its arguments are both indices and the squared distance of the descriptors, in the order of the left key points.
    /// Only the pairs compete that `visit(i, ..)` names for left key point `i`. The distance is that of the
    /// descriptors. With neighbours it is the inverse of a pair's supported weight, and ambiguous pairs are rejected
    /// unless `patterns` is set.
    pub(super) fn search(
        &mut self,
        test: Test,
        keypoints: [&[Keypoint]; 2],
        visit: impl Fn(usize, &mut dyn FnMut(usize)),
        squared: impl Fn(usize, usize) -> f32,
        mut accept: impl FnMut(usize, usize, f32),
    ) {
        let [left, right] = keypoints;
        let Self { nearest, candidates, pairs, ambiguous, domains, decisions } = self;
        nearest.reset(left.len(), right.len());
        let (supported, clear) = (test.neighbours > 0, test.squared_ratio);
        if supported {
            candidates.fill(keypoints, visit, &squared);
            candidates.support(left, right.len(), test.neighbours);
            for i in 0..left.len() {
                candidates.of(i).iter().for_each(|c| nearest.offer(i, c.right, 1.0 / c.weight));
            }
        } else {
            for i in 0..left.len() {
                visit(i, &mut |j| nearest.offer(i, j, squared(i, j)));
            }
        }
        pairs.clear();
        pairs.extend(nearest.mutual().filter(|pair| pair.clear(clear)).map(|pair| (pair.left, pair.right)));
        ambiguous.clear();
        ambiguous.resize(pairs.len(), false);
        if supported && clear < 1.0 && !test.patterns {
            candidates.ambiguous(pairs, clear, ambiguous);
            if candidates.spread(left, pairs, test.neighbours, ambiguous) {
                domains.decide(candidates, keypoints, decisions);
                resolve(decisions, right.len(), pairs, ambiguous);
            }
        }
        for (&(i, j), _) in pairs.iter().zip(ambiguous).filter(|(_, ambiguous)| !**ambiguous) {
            accept(i, j, squared(i, j));
        }
    }
}

/// Sets the pairs of the decided left key points, and drops other pairs of their right ones.
fn resolve(decisions: &[Option<usize>], right: usize, pairs: &mut Vec<(usize, usize)>, ambiguous: &mut Vec<bool>) {
    let mut matched = vec![false; right];
    let mut resolved: Vec<((usize, usize), bool)> = Vec::new();
    for (i, decision) in decisions.iter().enumerate() {
        if let Some(j) = *decision {
            matched[j] = true;
            resolved.push(((i, j), false));
        }
    }
    let others = pairs.iter().copied().zip(ambiguous.iter().copied());
    resolved.extend(others.filter(|&((i, j), _)| decisions[i].is_none() && !matched[j]));
    resolved.sort_unstable();
    (*pairs, *ambiguous) = resolved.into_iter().unzip();
}
