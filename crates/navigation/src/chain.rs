//! The camera's pose relative to an object, propagated by odometry: the paper's Eq. (2) and (6).

use seafix_geometry::{Camera, Covariance6, Object, Transform, World};

use crate::{
    consider_states::ConsiderStates,
    correlated_error::{CorrelatedSensitivities, carried},
    odometry_trajectory::RelativeMotion,
};

/// The camera's pose relative to an object, with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectPose {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Object, Camera>,
    /// Cross-covariance of the pose error with the correlated errors of the odometry.
    pub(crate) sensitivities: CorrelatedSensitivities,
    /// Sensitivity of the pose error to the errors of models and surveys.
    pub(crate) consider_states: ConsiderStates,
}

/// The camera's pose relative to an object, from two poses in the world: the paper's Eq. (2).
///
/// `object_from_camera = object_from_world · world_from_camera`. The error of the surveyed placement enters the result.
pub fn by_world(
    world_from_object: &Transform<World, Object>,
    world_from_camera: &Transform<World, Camera>,
) -> Transform<Object, Camera> {
    world_from_object.inverse() * *world_from_camera
}

impl ObjectPose {
    /// A pose whose error is independent of all other errors.
    pub fn new(object_from_camera: Transform<Object, Camera>, covariance: Covariance6<Object, Camera>) -> Self {
        let consider_states = ConsiderStates::default();
        Self { object_from_camera, covariance, sensitivities: CorrelatedSensitivities::zeros(), consider_states }
    }

    /// The same pose, with the part of its covariance that errors of models and surveys cause.
    #[must_use]
    pub fn with_consider_states(self, consider_states: ConsiderStates) -> Self {
        Self { consider_states, ..self }
    }

    /// The pose after one step of dead reckoning: the paper's Eq. (6).
    ///
    /// `object_from_later = object_from_earlier · earlier_from_later`. (The equation is misprinted and would multiply
    /// by the identity; this is the meaning of its text.)
    ///
    /// The covariance is propagated to first order: Σ' = A Σ Aᵀ + Σ_step, A = Ad(later_from_earlier). The errors of
    /// pose and step count as independent, except for [correlated errors](crate::CorrelatedError) of the odometry.
    #[must_use]
    pub fn after(&self, step: &RelativeMotion) -> Self {
        let (covariance, sensitivities) = carried(&self.covariance.matrix, &self.sensitivities, step);
        Self {
            object_from_camera: (self.object_from_camera * step.motion).renormalized(),
            covariance: Covariance6::new(covariance),
            sensitivities,
            consider_states: self.consider_states.carried(&step.motion.inverse().adjoint()),
        }
    }

    /// The pose after several steps, in order of time; without a step it is unchanged to the last bit.
    #[must_use]
    pub fn after_all<'a>(&self, steps: impl IntoIterator<Item = &'a RelativeMotion>) -> Self {
        steps.into_iter().fold(self.clone(), |here, step| here.after(step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertain_heading_becomes_uncertain_place() {
        // One milliradian about y and 10 m ahead give 10 mm sideways.
        let mut known = Covariance6::<Object, Camera>::isotropic(1e-9, 1e-9).matrix;
        known[(1, 1)] = 1e-6;
        let here = ObjectPose::new(Transform::identity(), Covariance6::new(known));
        let ahead = Transform::exp(&[0.0, 0.0, 0.0, 0.0, 0.0, 10.0].into());
        let there = here.after(&RelativeMotion::new(ahead, Covariance6::isotropic(1e-9, 1e-9)));
        assert!((there.covariance.matrix[(3, 3)].sqrt() - 0.01).abs() < 1e-6);
        assert_eq!(there.object_from_camera.translation().z, 10.0);
    }

    #[test]
    fn the_world_drops_out() {
        let world_from_object = Transform::<World, Object>::exp(&[0.3, -0.2, 1.0, 4.0, 5.0, 6.0].into());
        let object_from_camera = Transform::<Object, Camera>::exp(&[0.1, 0.2, -0.4, 1.0, 0.5, -3.0].into());
        let found = by_world(&world_from_object, &(world_from_object * object_from_camera));
        assert!((found.matrix() - object_from_camera.matrix()).amax() < 1e-14);
    }
}
