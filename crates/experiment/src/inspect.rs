//! What the vehicle is there for: where it has the points of interest, against where they are.

use nalgebra::Vector3;
use seafix_geometry::{Object, Point, StereoRig, Transform, World};
use seafix_log::InspectedPoint;
use seafix_navigation::{Navigated, Place, Standing};
use seafix_referencing::{Interest, Outcome, Site, TargetKind};

use seafix::{Sighting, Underway};
use seafix_data::source::Truth;

/// The points of interest that truly lie in both images and are turned towards the left camera.
///
/// What is believed comes from the navigated pose, and without navigation from the fix of the point's own object, else
/// from the first of the frame: e = camera_from_object_est · p − camera_from_object_true · p. To an object that is not
/// the pose's own it goes by the survey, whose errors it then has. What hides a point is not looked for.
pub(crate) fn inspected(
    truth: &Truth,
    site: &Site,
    rig: &StereoRig,
    kind: TargetKind,
    sighting: &Sighting,
    underway: Option<&Underway>,
) -> Vec<InspectedPoint> {
    let camera_from_world = truth.world_from_camera.inverse();
    let mut points = Vec::new();
    for (o, (object, place)) in site.objects.iter().zip(&truth.world_from_object).enumerate() {
        let Some(world_from_object) = place else { continue };
        let camera_from_object = camera_from_world * *world_from_object;
        let eye = camera_from_object.inverse() * Point::from(Vector3::zeros());
        let mut known: Option<Option<Standing>> = None;
        for interest in object.interest.iter().filter(|interest| turned(interest, &eye)) {
            let at = camera_from_object * interest.at;
            if rig.sees(&at, 0.0).is_none() {
                continue;
            }
            let standing = known.get_or_insert_with(|| standing(o, site, kind, sighting, underway)).as_ref();
            let believed = standing.map(|standing| standing.object_from_camera.inverse() * interest.at);
            let nees = believed.zip(standing).and_then(|(believed, standing)| {
                let error = believed - at;
                let information = standing.covariance.of_point(&believed).cholesky()?;
                Some(error.dot(&information.solve(&error)))
            });
            points.push(InspectedPoint {
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

/// Whether the side that is to be looked at is turned towards a place, object frame.
fn turned(interest: &Interest, eye: &Point<Object>) -> bool {
    interest.normal.is_none_or(|normal| normal.dot(&(*eye - interest.at)) > 0.0)
}

/// The pose relative to `object` that is known after a frame.
fn standing(
    object: usize,
    site: &Site,
    kind: TargetKind,
    sighting: &Sighting,
    underway: Option<&Underway>,
) -> Option<Standing> {
    // The object whose frame a target's pose is in.
    let own = |target: usize| if kind == TargetKind::Site { site.frame } else { target };
    let known = match underway {
        Some(underway) => underway.pose.clone().map(|pose| Navigated { object: own(pose.object), ..pose })?,
        None => {
            let fixes = sighting.attempts.iter().filter_map(|attempt| match &attempt.answer.outcome {
                Outcome::Referenced(fix) => Some(Navigated {
                    object: own(attempt.target),
                    standing: Standing::new(fix.object_from_camera, fix.covariance),
                }),
                _ => None,
            });
            let fixes: Vec<Navigated> = fixes.collect();
            fixes.iter().find(|fix| fix.object == object).or(fixes.first())?.clone()
        }
    };
    if known.object == object {
        return Some(known.standing);
    }
    let surveyed = |o: usize| -> Option<Place> {
        let object = &site.objects[o];
        let world_from_object: Transform<World, Object> = object.world_from_object?;
        Some(Place { world_from_object, covariance: object.survey_covariance()? })
    };
    let both = [surveyed(known.object)?, surveyed(object)?];
    Some(Navigated { object: 0, ..known }.passed_to(1, &both).standing)
}
