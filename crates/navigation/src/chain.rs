//! A fix carried along: the paper's Eq. (2) and (6).

use seafix_geometry::{Camera, Covariance6, Object, Transform, World};

use crate::{
    ConsiderStates, RelativeMotion,
    correlated_error::{CorrelatedSensitivities, carried},
};

/// Where the camera is relative to an object, and how well that is known.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectPose {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Object, Camera>,
    /// What its error shares with errors of the odometry that last.
    pub(crate) sensitivities: CorrelatedSensitivities,
    /// What its error shares with those of models and surveys.
    pub(crate) consider_states: ConsiderStates,
}

/// Eq. (2), the way by the world: `object_from_camera = object_from_world · world_from_camera`. What the survey errs by
/// in placing the object errs here too.
pub fn by_world(
    world_from_object: &Transform<World, Object>,
    world_from_camera: &Transform<World, Camera>,
) -> Transform<Object, Camera> {
    world_from_object.inverse() * *world_from_camera
}

impl ObjectPose {
    /// A pose that errs independently of all others.
    pub fn new(object_from_camera: Transform<Object, Camera>, covariance: Covariance6<Object, Camera>) -> Self {
        let consider_states = ConsiderStates::default();
        Self { object_from_camera, covariance, sensitivities: CorrelatedSensitivities::zeros(), consider_states }
    }

    /// The same, part of its covariance being due to errors that other fixes have too.
    #[must_use]
    pub fn with_consider_states(self, consider_states: ConsiderStates) -> Self {
        Self { consider_states, ..self }
    }

    /// Eq. (6), one step of dead reckoning: `object_from_later = object_from_earlier · earlier_from_later`. (As printed
    /// the equation multiplies by the identity; this is what its text says.)
    ///
    /// The covariance is carried along and that of the step added, Σ' = A Σ Aᵀ + Σ_step, A = Ad(later_from_earlier), the
    /// two taken as independent but for errors of the odometry that [last](crate::CorrelatedError).
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

    /// The same over many steps, in their order; without a step it is the same to the last bit.
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
        // One milliradian about y, then 10 m ahead: 10 mm across.
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
