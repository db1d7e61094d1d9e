//! Trajectory errors against a reference: absolute and relative pose error, drift over segments.
//!
//! The definitions are those of evo 1.38 (Grupp, 2017): association by nearest stamp, Umeyama alignment, [`ape`] and
//! [`rpe`] by [`Relation`]. [`drift`] is that of the KITTI benchmark (Geiger et al., 2012), with configurable lengths.
//!
//! ```
//! use seafix_evaluation::trajectory::{Pose, Relation, Summary, ape};
//!
//! let at = |x: f64| Pose { position: [x, 0.0, 0.0].into(), ..Pose::IDENTITY };
//! let (reference, estimate) = ([at(0.0), at(1.0)], [at(0.3), at(1.4)]);
//! let errors = ape(&reference, &estimate, Relation::Translation);
//! assert!((Summary::of(&errors).max - 0.4).abs() < 1e-15);
//! ```

mod align;
mod associate;
mod drift;
mod pairs;
mod relation;
mod summary;

pub use align::{Alignment, UndeterminedAlignment, align};
pub use associate::associate;
pub use drift::{DriftSegment, drift};
pub use pairs::{Delta, pairs};
pub use relation::Relation;
pub use summary::Summary;

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

/// The absolute pose error (APE) of each pair: the [`Relation`]'s measure of E = reference⁻¹ · estimate.
///
/// # Panics
/// If the trajectories differ in length; associate them first.
pub fn ape(reference: &[Pose], estimate: &[Pose], relation: Relation) -> Vec<f64> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of equal length");
    reference.iter().zip(estimate).map(|(reference, estimate)| relation.absolute(reference, estimate)).collect()
}

/// The relative pose error (RPE) of each pair (i, j) of instants.
///
/// It is the [`Relation`]'s measure of E = (reference_i⁻¹ · reference_j)⁻¹ · (estimate_i⁻¹ · estimate_j).
///
/// # Panics
/// If the trajectories differ in length, or if an index exceeds it.
pub fn rpe(reference: &[Pose], estimate: &[Pose], pairs: &[(usize, usize)], relation: Relation) -> Vec<f64> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of equal length");
    pairs
        .iter()
        .filter_map(|&(i, j)| relation.relative(&reference[i].to(&reference[j]), &estimate[i].to(&estimate[j])))
        .collect()
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
