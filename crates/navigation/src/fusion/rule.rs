//! The rule that combines a fix with the navigated pose.

use crate::chain::ObjectPose;

/// A fix that contradicts the known pose.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("normalised innovation squared {nis:.1}; the limit is {limit:.1}")]
pub struct Contradiction {
    /// The normalised innovation squared (NIS), χ² with six degrees of freedom.
    pub nis: f64,
    /// The limit of the gate.
    pub limit: f64,
}

/// A fusion: it combines the known pose with a fix of the same object.
///
/// ```
/// use seafix_component::Choice;
/// use seafix_geometry::{Camera, Covariance6, Object, Transform};
/// use seafix_navigation::{FUSIONS, ObjectPose};
///
/// let at = |x: f64| {
///     let pose = Transform::<Object, Camera>::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into());
///     ObjectPose::new(pose, Covariance6::isotropic(0.1, 0.1))
/// };
/// let fusion = FUSIONS.build(&Choice::named("fuse")).unwrap();
/// let fused = fusion.take(&at(0.0), &at(0.1)).unwrap();
/// assert!((fused.object_from_camera.translation().x - 0.05).abs() < 1e-9, "equal covariances: the mean");
/// assert!(fusion.take(&at(0.0), &at(5.0)).is_err(), "35 standard deviations off");
/// ```
pub trait Fusion: Send + Sync + std::fmt::Debug {
    /// The pose after a fix; `known` is the pose before it, relative to the same object.
    ///
    /// # Errors
    /// [`Contradiction`] if the fix fails the gate.
    fn take(&self, known: &ObjectPose, fix: &ObjectPose) -> Result<ObjectPose, Contradiction>;

    /// Whether a fix of another object makes the navigated pose relative to that object.
    ///
    /// `there` is the fused pose relative to the new object, `here` the pose relative to the current one. By
    /// default it does unless that would more than double the standard deviation of the position, as for an object at
    /// the edge of the image.
    fn passes(&self, here: &ObjectPose, there: &ObjectPose) -> bool {
        /// Maximum ratio of the standard deviations of `there` and `here`.
        const POOR: f64 = 2.0;
        there.covariance.position_rms() <= POOR * here.covariance.position_rms()
    }
}
