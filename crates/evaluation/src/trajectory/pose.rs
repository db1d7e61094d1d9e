//! Poses of a trajectory, and its length.

use nalgebra::{Matrix3, Vector3};

/// A pose as its file stores it: reference from body.
///
/// The rotation remains a matrix: KITTI files have it orthonormal to six digits only, and a correction would change
/// errors relative to other programs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The axes of the body in the reference frame, as columns.
    pub rotation: Matrix3<f64>,
    /// The origin of the body in the reference frame (m).
    pub position: Vector3<f64>,
}

impl Pose {
    /// The identity pose.
    pub const IDENTITY: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        position: Vector3::new(0.0, 0.0, 0.0),
    };

    /// The composition with `next`: `a_from_c = a_from_b · b_from_c`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self { rotation: self.rotation * next.rotation, position: self.rotation * next.position + self.position }
    }

    /// The pose of `other` relative to this one: `self⁻¹ · other`, with the transpose as the inverse of a rotation.
    #[must_use]
    pub fn to(&self, other: &Self) -> Self {
        let back = self.rotation.transpose();
        Self { rotation: back * other.rotation, position: back * (other.position - self.position) }
    }
}

/// The path length up to each pose (m), from zero.
pub fn path_lengths(poses: &[Pose]) -> Vec<f64> {
    let mut length = 0.0;
    let steps = poses.windows(2).map(|step| (step[1].position - step[0].position).norm());
    std::iter::once(0.0)
        .take(poses.len())
        .chain(steps.map(|step| {
            length += step;
            length
        }))
        .collect()
}
