//! Rigid motions out of records, checked.

use crate::{
    proto::foxglove::{Pose, Quaternion, Vector3},
    record::{FrameRecord, Matrix4, TargetModel, TrialHeader},
};
use seafix_geometry::{Body, Camera, Frame, Object, RightCamera, Site, Transform, World};

/// The motion of a matrix, or what is wrong with it.
fn motion<A: Frame, B: Frame>(name: &str, m: &Matrix4) -> Result<Transform<A, B>, String> {
    let m = nalgebra::Matrix4::from_fn(|row, column| m[row][column]);
    Transform::from_matrix(&m).map_err(|error| format!("{name}: {error}"))
}

/// The places that stay where they are during a trial.
#[derive(Debug)]
pub(crate) struct Places {
    pub(super) world_from_site: Option<Transform<World, Site>>,
    /// Of the targets whose place in the site is known, by their ids.
    pub(super) site_from_object: Vec<(String, Transform<Site, Object>)>,
    pub(super) body_from_camera: Transform<Body, Camera>,
    pub(super) right_from_left: Transform<RightCamera, Camera>,
}

impl Places {
    /// The places of `header`, or what is wrong with them.
    pub(crate) fn of(header: &TrialHeader) -> Result<Self, String> {
        let target = |target: &TargetModel| {
            let name = format!("site_from_object of target `{}`", target.id);
            let place = target.site_from_object.as_ref()?;
            Some(motion(&name, place).map(|place| (target.id.clone(), place)))
        };
        Ok(Self {
            world_from_site: header.world_from_site.as_ref().map(|m| motion("world_from_site", m)).transpose()?,
            site_from_object: header.targets.iter().filter_map(target).collect::<Result<_, String>>()?,
            body_from_camera: motion("body_from_camera", &header.body_from_camera)?,
            right_from_left: motion("rig.right_from_left", &header.rig.right_from_left)?,
        })
    }

    /// Where the target of this id is in the site, if that is known.
    pub(super) fn of_target(&self, id: &str) -> Option<&Transform<Site, Object>> {
        self.site_from_object.iter().find(|(known, _)| known == id).map(|(_, place)| place)
    }

    /// The poses of `frame`, or what is wrong with them.
    pub(super) fn poses(&self, frame: &FrameRecord) -> Result<Poses, String> {
        let camera_from_body = self.body_from_camera.inverse();
        let world = |name: &str, m: &Matrix4| motion::<World, Camera>(name, m).map(|place| place * camera_from_body);
        let mut estimate = None;
        for target in &frame.targets {
            if let Some(m) = &target.object_from_camera {
                let object_from_camera = motion::<Object, Camera>("object_from_camera", m)?;
                if let (None, Some(site_from_object)) = (&estimate, self.of_target(&target.object)) {
                    estimate = Some(*site_from_object * object_from_camera * camera_from_body);
                }
            }
        }
        Ok(Poses {
            estimate,
            truth: match &frame.truth {
                Some(truth) => Some(world("truth.world_from_camera", &truth.world_from_camera)?),
                None => None,
            },
            prior: match &frame.prior {
                Some(prior) => Some(world("prior.world_from_camera", &prior.world_from_camera)?),
                None => None,
            },
        })
    }
}

/// Where the vehicle is in one frame, as far as it is known; the estimate is that of the first
/// referenced target whose place in the site is known.
#[derive(Debug)]
pub(super) struct Poses {
    pub(super) estimate: Option<Transform<Site, Body>>,
    pub(super) truth: Option<Transform<World, Body>>,
    pub(super) prior: Option<Transform<World, Body>>,
}

/// Translation and rotation as the messages write them.
pub(super) fn parts<A: Frame, B: Frame>(a_from_b: &Transform<A, B>) -> (Vector3, Quaternion) {
    let (t, q) = (a_from_b.translation(), a_from_b.rotation());
    (Vector3 { x: t.x, y: t.y, z: t.z }, Quaternion { x: q.i, y: q.j, z: q.k, w: q.w })
}

/// A pose message.
pub(super) fn pose<A: Frame, B: Frame>(a_from_b: &Transform<A, B>) -> Pose {
    let (position, orientation) = parts(a_from_b);
    Pose { position: Some(position), orientation: Some(orientation) }
}
