//! Poses as trajectory files write them.

use nalgebra::{Rotation3, UnitQuaternion};
use seafix_component::Fault;
use seafix_evaluation::trajectory::Pose;

/// A trajectory: the poses of a body in the order of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// The stamp of each pose (ns), strictly increasing; `None` for a KITTI file.
    pub stamps: Option<Vec<u64>>,
    /// The poses, `reference_from_body`.
    pub poses: Vec<Pose>,
    /// The indices of the poses before which the trajectory is broken. The motion to such a pose is unknown; a line `#
    /// broken: …` marks it in the file.
    pub breaks: Vec<usize>,
    /// Whether the poses have an attitude; otherwise only their positions are known.
    pub has_attitude: bool,
    /// Warnings about the numbers of the file.
    pub warnings: Vec<Fault>,
}

/// The quaternion (w, x, y, z) of a pose with w ≥ 0.
pub(super) fn quaternion(pose: &Pose) -> [f64; 4] {
    let mut rotation = Rotation3::from_matrix_unchecked(pose.rotation);
    rotation.renormalize();
    let q = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
    let q = if q.w < 0.0 { -q } else { q };
    [q.w, q.i, q.j, q.k]
}
