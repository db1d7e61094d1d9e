//! Points of the cloud for a random alternative.

use nalgebra::Vector3;
use seafix_geometry::MeasuredPoint;

use crate::problem::Problem;

/// Confidence of the χ² test that sets must pass.
pub(crate) const CONFIDENCE: f64 = 0.999;

/// Whether the null model shuffles partners: pairs are given without a prior, and not every possible pair.
pub(crate) fn shuffled(problem: &Problem<'_>) -> bool {
    let lists = &problem.candidates.lists;
    problem.prior.is_none() && lists.iter().any(|list| !list.is_empty() && list.len() < problem.cloud.len())
}

/// The measured place of a point in the camera frame.
pub(super) fn coordinates(point: &MeasuredPoint) -> Vector3<f64> {
    point.position.at.coords
}
