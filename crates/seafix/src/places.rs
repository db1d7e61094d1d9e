//! Places of the targets.

use seafix_geometry::{Covariance6, Object};
use seafix_navigation::ObjectPlacement;
use seafix_referencing::Target;

/// The surveyed poses of the targets in the world.
///
/// # Panics
/// A target without a pose in the world.
pub fn places(targets: &[Target]) -> Vec<ObjectPlacement> {
    let place = |target: &Target| ObjectPlacement {
        world_from_object: target.world_from_object.expect("checked when the source was opened"),
        covariance: target.survey.unwrap_or_else(|| Covariance6::<_, Object>::new(nalgebra::Matrix6::zeros())),
    };
    targets.iter().map(place).collect()
}
