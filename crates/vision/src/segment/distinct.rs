//! Removal of segments that repeat another.

use super::fit::FittedSegment;

/// The distance (px) within which two fitted lines are one.
const SAME: f64 = 1.0;
/// The minimum cosine between their normals.
const ALIGNED: f64 = 0.998;

/// Keeps the longest of the segments of one edge, in the order of length.
///
/// Pieces of an edge that were followed beyond their detected ends overlap. A segment repeats a longer one if the
/// middle between its half-points lies beside it and both lines agree there.
pub(crate) fn keep_distinct(segments: &mut Vec<FittedSegment>) {
    segments.sort_by(|a, b| b.length.total_cmp(&a.length));
    let mut kept = 0;
    for i in 0..segments.len() {
        let segment = segments[i];
        if !segments[..kept].iter().any(|longer| repeats(&segment, longer)) {
            segments[kept] = segment;
            kept += 1;
        }
    }
    segments.truncate(kept);
}

/// Whether the segment's half-points lie on the line of `longer`, and their middle beside it.
fn repeats(segment: &FittedSegment, longer: &FittedSegment) -> bool {
    let [a, b] = &longer.offsets;
    if segment.offsets[0].normal.dot(&a.normal) < ALIGNED {
        return false;
    }
    let step = nalgebra::Vector2::new(b.at.u - a.at.u, b.at.v - a.at.v);
    let from = |at: &seafix_geometry::Pixel| nalgebra::Vector2::new(at.u - a.at.u, at.v - a.at.v);
    let near = segment.offsets.iter().all(|half| from(&half.at).dot(&a.normal).abs() < SAME);
    let middle = 0.5 * (from(&segment.offsets[0].at) + from(&segment.offsets[1].at));
    // The half-points lie at 1/√3 of the half length, so the ends are at 0.5 ± 0.5·√3 between them.
    let along = middle.dot(&step) / step.norm_squared();
    near && (along - 0.5).abs() < 0.5 * 3f64.sqrt()
}
