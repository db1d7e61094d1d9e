//! The camera's pose relative to one object of a site, and its transfer to another object.

use seafix_geometry::{Covariance6, Object, Transform, World};

use crate::{
    chain::{ObjectPose, by_world},
    consider_states::ConsiderStates,
    odometry_trajectory::RelativeMotion,
};

/// The camera's pose relative to one object of the site.
///
/// A vehicle works at an object, so its pose relative to *that* object counts. The error of the survey is far larger
/// than that of a fix; it enters only when the pose is transferred from one object to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Navigated {
    /// The object, as its index in the site.
    pub object: usize,
    /// The camera's pose relative to the object.
    pub object_pose: ObjectPose,
}

/// The placement of an object in the world, surveyed or estimated since.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectPlacement {
    /// The pose.
    pub world_from_object: Transform<World, Object>,
    /// Its covariance.
    pub covariance: Covariance6<World, Object>,
}

impl Navigated {
    /// The pose after the motion `step`: the paper's Eq. (6).
    #[must_use]
    pub fn after(&self, step: &RelativeMotion) -> Self {
        Self { object_pose: self.object_pose.after(step), object: self.object }
    }

    /// The camera's pose relative to the object `other`, by way of the world: the paper's Eq. (2).
    ///
    /// `object_m_from_camera` = W_m⁻¹ W_r T. With W_true = W Exp(ω) its error is ξ + Ad(T⁻¹) ω_r − Ad(T_m⁻¹) ω_m. Both
    /// survey errors ω are [consider states](ConsiderStates), so that a transfer to another object and back restores
    /// the covariance.
    #[must_use]
    pub fn passed_to(&self, other: usize, places: &[ObjectPlacement]) -> Self {
        if other == self.object {
            return self.clone();
        }
        let (from, to) = (&places[self.object], &places[other]);
        let here = self.object_pose.object_from_camera;
        let pose = by_world(&to.world_from_object, &(from.world_from_object * here));
        let (near, far) = (here.inverse().adjoint(), pose.inverse().adjoint());
        let surveys = ConsiderStates::of_survey(self.object, &near, &from.covariance.matrix)
            .plus(&ConsiderStates::of_survey(other, &-far, &to.covariance.matrix));
        let common = self.object_pose.consider_states.common(&surveys);
        let covariance = self.object_pose.covariance.matrix + surveys.common(&surveys) + common + common.transpose();
        let object_pose = ObjectPose {
            object_from_camera: pose.renormalized(),
            covariance: Covariance6::new(covariance),
            consider_states: self.object_pose.consider_states.clone().plus(&surveys),
            ..self.object_pose.clone()
        };
        Self { object: other, object_pose }
    }
}
