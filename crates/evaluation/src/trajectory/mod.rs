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
mod interpolate;
mod pairs;
mod plane;
mod pose;
mod relation;
mod summary;

pub use align::{Alignment, UndeterminedAlignment, align};
pub use associate::associate;
pub use drift::{DriftSegment, drift, drift_of_positions};
pub use interpolate::interpolate;
pub use pairs::{Delta, pairs};
pub use plane::Plane;
pub use pose::{Pose, path_lengths};
pub use relation::Relation;
pub use summary::Summary;

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
