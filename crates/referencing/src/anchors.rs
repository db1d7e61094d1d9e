//! The places that stand for an object where two of its poses are compared.

use std::borrow::Cow;

use crate::site::{edge::ModelEdge, model::ModelPoint};

/// Minimum number of points that stand for an object without the ends of its edges.
const MIN_ANCHOR_POINTS: usize = 3;

/// The points of an object and, if they are fewer than three, the ends of its edges too.
pub(crate) fn anchors<'a>(points: &'a [ModelPoint], edges: &[ModelEdge]) -> Cow<'a, [ModelPoint]> {
    if points.len() >= MIN_ANCHOR_POINTS {
        return Cow::Borrowed(points);
    }
    let ends = edges.iter().flat_map(|edge| {
        let ends = edge.places(points).into_iter().zip(edge.sigmas(points));
        ends.map(|(at, sigma)| ModelPoint { sigma, ..ModelPoint::exact("", at) })
    });
    points.iter().cloned().chain(ends).collect()
}
