//! Errors of the points of interest: estimated against true positions in the camera frame.

use nalgebra::Vector3;
use seafix_geometry::{Object, Point, StereoRig, Transform, World};
use seafix_log::PointOfInterest;
use seafix_navigation::{Navigated, ObjectPlacement, ObjectPose};
use seafix_referencing::{Interest, Outcome, Site, TargetKind};

use seafix::{FrameResult, NavigationState};
use seafix_data::source::Truth;

/// The points of interest in both true images and facing the left camera.
///
/// Their error is e = camera_from_object_est · p − camera_from_object_true · p. The estimate is the navigated pose;
/// without navigation it is the fix of the point's own object, otherwise the first fix of the frame. The pose of
/// another object follows by the survey and has the survey's errors. Occlusion is not considered.
pub(crate) fn poi(
    truth: &Truth,
    site: &Site,
    rig: &StereoRig,
    kind: TargetKind,
    frame_result: &FrameResult,
    navigation_state: Option<&NavigationState>,
) -> Vec<PointOfInterest> {
    let camera_from_world = truth.world_from_camera.inverse();
    let mut points = Vec::new();
    for (o, (object, place)) in site.objects.iter().zip(&truth.world_from_object).enumerate() {
        let Some(world_from_object) = place else { continue };
        let camera_from_object = camera_from_world * *world_from_object;
        let camera = camera_from_object.inverse() * Point::from(Vector3::zeros());
        let mut known: Option<Option<ObjectPose>> = None;
        for interest in object.interest.iter().filter(|interest| turned(interest, &camera)) {
            let at = camera_from_object * interest.at;
            if rig.sees(&at, 0.0).is_none() {
                continue;
            }
            let object_pose =
                known.get_or_insert_with(|| object_pose(o, site, kind, frame_result, navigation_state)).as_ref();
            let believed = object_pose.map(|object_pose| object_pose.object_from_camera.inverse() * interest.at);
            let nees = believed.zip(object_pose).and_then(|(believed, object_pose)| {
                let error = believed - at;
                let information = object_pose.covariance.of_point(&believed).cholesky()?;
                Some(error.dot(&information.solve(&error)))
            });
            points.push(PointOfInterest {
                object: object.id.clone(),
                point: interest.id.clone(),
                at: at.coords.into(),
                believed: believed.map(|at| at.coords.into()),
                nees,
            });
        }
    }
    points
}

/// Whether a point of interest faces a position in the object frame.
fn turned(interest: &Interest, camera: &Point<Object>) -> bool {
    interest.normal.is_none_or(|normal| normal.dot(&(*camera - interest.at)) > 0.0)
}

/// The estimated pose relative to `object` after a frame.
fn object_pose(
    object: usize,
    site: &Site,
    kind: TargetKind,
    frame_result: &FrameResult,
    navigation_state: Option<&NavigationState>,
) -> Option<ObjectPose> {
    // The object whose frame the pose of a target refers to.
    let own = |target: usize| if kind == TargetKind::Site { site.frame } else { target };
    let known = match navigation_state {
        Some(navigation_state) => {
            navigation_state.pose.clone().map(|pose| Navigated { object: own(pose.object), ..pose })?
        }
        None => {
            let fixes = frame_result.attempts.iter().filter_map(|attempt| match &attempt.answer.outcome {
                Outcome::Fix(fix) => Some(Navigated {
                    object: own(attempt.target),
                    object_pose: ObjectPose::new(fix.object_from_camera, fix.covariance),
                }),
                _ => None,
            });
            let fixes: Vec<Navigated> = fixes.collect();
            fixes.iter().find(|fix| fix.object == object).or(fixes.first())?.clone()
        }
    };
    if known.object == object {
        return Some(known.object_pose);
    }
    let surveyed = |o: usize| -> Option<ObjectPlacement> {
        let object = &site.objects[o];
        let world_from_object: Transform<World, Object> = object.world_from_object?;
        Some(ObjectPlacement { world_from_object, covariance: object.survey_covariance()? })
    };
    let both = [surveyed(known.object)?, surveyed(object)?];
    Some(Navigated { object: 0, ..known }.passed_to(1, &both).object_pose)
}
