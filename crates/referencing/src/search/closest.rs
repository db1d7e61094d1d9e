//! The common loop of the closest-point searches.

use seafix_geometry::{Camera, Object, Transform};

use super::association::vertices;
use crate::problem::{Correspondence, Problem};

/// The distance, fit and limits of a closest-point search.
pub(super) struct Closest<D, F> {
    /// Distance of a pair under a pose; a pair with NaN is no candidate.
    pub(super) distance: D,
    /// The pose of some pairs.
    pub(super) fit: F,
    /// Fraction of the nearest pairs that is fitted.
    pub(super) keep: f64,
    pub(super) iterations: usize,
    pub(super) budget: u64,
}

impl<D, F> Closest<D, F>
where
    D: Fn(&Transform<Object, Camera>, Correspondence) -> f64,
    F: Fn(&[Correspondence]) -> Option<Transform<Object, Camera>>,
{
    /// Alternates nearest candidates and pose until the pairs no longer change.
    ///
    /// Each round takes the nearest candidate of each model point and fits the pose to the nearest of these pairs.
    /// Returns the last pose, all candidate pairs, the number of distances, and whether the budget ended the loop.
    pub(super) fn run(
        &self,
        problem: &Problem<'_>,
        start: Transform<Object, Camera>,
    ) -> (Transform<Object, Camera>, Vec<Correspondence>, u64, bool) {
        let vertices = vertices(problem);
        let (mut pose, mut last, mut pair_tests) = (start, Vec::new(), 0);
        for _ in 0..self.iterations {
            if pair_tests + vertices.len() as u64 > self.budget {
                return (pose, vertices, pair_tests, true);
            }
            pair_tests += vertices.len() as u64;
            let groups = vertices.chunk_by(|a, b| a.model == b.model);
            let nearest = |same: &[Correspondence]| {
                let off = same.iter().map(|&pair| ((self.distance)(&pose, pair), pair));
                off.filter(|(off, _)| !off.is_nan()).min_by(|(a, _), (b, _)| a.total_cmp(b))
            };
            let mut pairs: Vec<(f64, Correspondence)> = groups.filter_map(nearest).collect();
            pairs.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            let kept = (self.keep * pairs.len() as f64).ceil() as usize;
            let mut pairs: Vec<Correspondence> = pairs.into_iter().take(kept).map(|(_, pair)| pair).collect();
            pairs.sort_unstable();
            if pairs == last {
                break;
            }
            // In the order of the vertices: sums do not depend on the order of the points.
            let chosen: Vec<Correspondence> =
                vertices.iter().copied().filter(|pair| pairs.binary_search(pair).is_ok()).collect();
            match (self.fit)(&chosen).filter(Transform::is_finite) {
                Some(next) => (pose, last) = (next, pairs),
                None => break,
            }
        }
        (pose, vertices, pair_tests, false)
    }
}
