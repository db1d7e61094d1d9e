//! Drift of odometry relative to the path length (KITTI).

use super::{
    pose::{Pose, path_lengths},
    relation::angle,
};

/// The drift over one segment of the reference path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftSegment {
    /// Index of the first pose.
    pub from: usize,
    /// Index of the last pose.
    pub to: usize,
    /// Nominal length (m).
    pub length: f64,
    /// Translation error divided by `length`; 0.01 is one per cent.
    pub translation: f64,
    /// Rotation error divided by `length` (rad/m).
    pub rotation: f64,
}

/// The drift over all segments of the nominal `lengths` (m).
///
/// A segment runs from each pose to the first pose at least this length further along the reference path. The error is
/// (estimate_i⁻¹ · estimate_j)⁻¹ · (reference_i⁻¹ · reference_j), as in the KITTI benchmark (Geiger et al., 2012),
/// which starts at every tenth pose and uses 100 to 800 m.
///
/// # Panics
/// If the trajectories differ in length.
pub fn drift(reference: &[Pose], estimate: &[Pose], lengths: &[f64]) -> Vec<DriftSegment> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of equal length");
    let path = path_lengths(reference);
    let segment = |from: usize, length: f64| {
        let to = from + path[from..].partition_point(|end| end - path[from] < length);
        let (a, b) = (reference[from], reference.get(to)?);
        let error = estimate[from].to(&estimate[to]).to(&a.to(b));
        let (translation, rotation) = (error.position.norm() / length, angle(&error.rotation) / length);
        Some(DriftSegment { from, to, length, translation, rotation })
    };
    let segment = &segment;
    lengths.iter().flat_map(|&length| (0..reference.len()).filter_map(move |from| segment(from, length))).collect()
}

/// The drift over segments of a trajectory whose attitude is unknown.
///
/// The error is the difference of the two distances from the first to the last position of a segment, divided by the
/// length: it is the part of the drift along the path, and unlike [`drift`] independent of the axes.
///
/// # Panics
/// If the trajectories differ in length.
pub fn drift_of_positions(reference: &[Pose], estimate: &[Pose], lengths: &[f64]) -> Vec<DriftSegment> {
    let error =
        |poses: &[Pose], segment: &DriftSegment| (poses[segment.to].position - poses[segment.from].position).norm();
    let mut segments = drift(reference, estimate, lengths);
    for segment in &mut segments {
        let apart = (error(reference, segment) - error(estimate, segment)).abs();
        (segment.translation, segment.rotation) = (apart / segment.length, f64::NAN);
    }
    segments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_per_cent_too_long_is_one_per_cent_of_drift() {
        let line = |scale: f64| -> Vec<Pose> {
            (0..21).map(|i| Pose { position: [f64::from(i) * scale, 0.0, 0.0].into(), ..Pose::IDENTITY }).collect()
        };
        let segments = drift(&line(1.0), &line(1.01), &[5.0, 40.0]);
        assert_eq!(segments.len(), 16, "starts with five metres left; forty are never reached");
        assert!(segments.iter().all(|segment| (segment.translation - 0.01).abs() < 1e-12 && segment.rotation < 1e-12));
        let turned = line(1.01).into_iter().map(|pose| Pose { position: pose.position.yzx(), ..pose });
        let positions = drift_of_positions(&line(1.0), &turned.collect::<Vec<_>>(), &[5.0]);
        assert!(
            positions.iter().all(|segment| (segment.translation - 0.01).abs() < 1e-12 && segment.rotation.is_nan())
        );
    }
}
