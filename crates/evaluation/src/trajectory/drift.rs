//! Drift of odometry, in per cent of the way.

use super::{Pose, path_lengths, relation::angle};

/// What an estimate drifts over one stretch of the reference's path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftSegment {
    /// The pose it starts from.
    pub from: usize,
    /// The pose it ends at.
    pub to: usize,
    /// The length wanted (m).
    pub length: f64,
    /// Error of the translation over `length`: a share, 0.01 is one per cent.
    pub translation: f64,
    /// Error of the rotation over `length` (rad/m).
    pub rotation: f64,
}

/// The drift over every stretch of the wanted `lengths` (m): from each pose to the first at least
/// so far along the reference's path.
///
/// As the KITTI benchmark measures it (Geiger et al., 2012), which starts at every tenth pose and
/// takes 100 to 800 m: the error of a stretch is (estimate_i⁻¹ · estimate_j)⁻¹ · (reference_i⁻¹ · reference_j).
///
/// # Panics
/// When the two are not of one length.
pub fn drift(reference: &[Pose], estimate: &[Pose], lengths: &[f64]) -> Vec<DriftSegment> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of one length");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_per_cent_too_long_is_one_per_cent_of_drift() {
        let line = |scale: f64| -> Vec<Pose> {
            (0..21).map(|i| Pose { position: [f64::from(i) * scale, 0.0, 0.0].into(), ..Pose::IDENTITY }).collect()
        };
        let segments = drift(&line(1.0), &line(1.01), &[5.0, 40.0]);
        assert_eq!(segments.len(), 16, "starts with five metres ahead of them; forty are never reached");
        assert!(segments.iter().all(|segment| (segment.translation - 0.01).abs() < 1e-12 && segment.rotation < 1e-12));
    }
}
