//! Trajectories against a reference: absolute and relative pose error, drift over segments.
//!
//! The definitions are those of evo 1.38 (Grupp, 2017), which this field compares by: association by
//! nearest stamp, alignment after Umeyama, [`ape`] and [`rpe`] per [`Relation`]. [`drift`] is the
//! KITTI benchmark's (Geiger et al., 2012) with lengths of one's own.
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

/// A pose as its file gives it: reference from body.
///
/// The rotation stays a matrix: in a KITTI file it is orthonormal to six digits only, and a repair
/// would change the errors that other programs print.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The axes of the body in the reference frame, as columns.
    pub rotation: Matrix3<f64>,
    /// The origin of the body in the reference frame (m).
    pub position: Vector3<f64>,
}

impl Pose {
    /// The body at the origin.
    pub const IDENTITY: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        position: Vector3::new(0.0, 0.0, 0.0),
    };

    /// This pose and then `next`: `a_from_c = a_from_b · b_from_c`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self { rotation: self.rotation * next.rotation, position: self.rotation * next.position + self.position }
    }

    /// `other` seen from this pose: `self⁻¹ · other`, the inverse of a rotation being its transpose.
    #[must_use]
    pub fn to(&self, other: &Self) -> Self {
        let back = self.rotation.transpose();
        Self { rotation: back * other.rotation, position: back * (other.position - self.position) }
    }
}

/// The absolute pose error of each pair: the [`Relation`]'s size of E = reference⁻¹ · estimate.
///
/// # Panics
/// When the two are not of one length: associate them first.
pub fn ape(reference: &[Pose], estimate: &[Pose], relation: Relation) -> Vec<f64> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of one length");
    reference.iter().zip(estimate).map(|(reference, estimate)| relation.absolute(reference, estimate)).collect()
}

/// The relative pose error of each of these pairs (i, j) of instants: the [`Relation`]'s size of
/// E = (reference_i⁻¹ · reference_j)⁻¹ · (estimate_i⁻¹ · estimate_j).
///
/// # Panics
/// When the two are not of one length, or a pair points beyond them.
pub fn rpe(reference: &[Pose], estimate: &[Pose], pairs: &[(usize, usize)], relation: Relation) -> Vec<f64> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of one length");
    pairs
        .iter()
        .filter_map(|&(i, j)| relation.relative(&reference[i].to(&reference[j]), &estimate[i].to(&estimate[j])))
        .collect()
}

/// The length of the path up to each pose (m), from zero.
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
