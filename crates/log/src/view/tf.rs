//! The tree of frames, and the vehicle in it.

use crate::{
    proto::foxglove::{FrameTransform, FrameTransforms, PoseInFrame},
    record::FrameRecord,
    topic,
};
use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Body, Frame, Transform, World};

use super::{
    names::{AUV, AUV_PRIOR, AUV_TRUTH, CAMERAS, SPS, WORLD, object_frame},
    rigid::{Places, parts, pose},
    values::timestamp,
};

fn edge<A: Frame, B: Frame>(parent: &str, child: &str, parent_from_child: &Transform<A, B>) -> FrameTransform {
    let (translation, rotation) = parts(parent_from_child);
    FrameTransform {
        timestamp: None,
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(translation),
        rotation: Some(rotation),
    }
}

fn stamped(mut transforms: Vec<FrameTransform>, stamp_ns: u64) -> FrameTransforms {
    transforms.iter_mut().for_each(|edge| edge.timestamp = Some(timestamp(stamp_ns)));
    FrameTransforms { transforms }
}

/// The edges that hold throughout a trial; written at its start.
pub(crate) fn fixed_transforms(places: &Places, stamp_ns: u64) -> FrameTransforms {
    // North, east, down to east, north, up; forward, starboard, down to forward, port, up.
    let enu = Transform::<World, World>::from_axes(
        &Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0),
        Vector3::zeros(),
    );
    let flu = Transform::<Body, Body>::from_axes(&Matrix3::from_diagonal(&[1.0, -1.0, -1.0].into()), Vector3::zeros());
    let mut edges = vec![edge(WORLD, "world_enu", &enu)];
    edges.extend(places.world_from_site.iter().map(|place| edge(WORLD, SPS, place)));
    edges.extend(places.site_from_object.iter().map(|(id, place)| edge(SPS, &object_frame(id), place)));
    edges.push(edge(AUV, "auv_flu", &flu));
    edges.push(edge(AUV, CAMERAS[0], &places.body_from_camera));
    edges.push(edge(CAMERAS[0], CAMERAS[1], &places.right_from_left.inverse()));
    edges.push(edge(AUV_TRUTH, "camera_left_truth", &places.body_from_camera));
    stamped(edges, stamp_ns)
}

/// The edges that one frame moves, or what is wrong with its poses.
pub(crate) fn moving_transforms(places: &Places, frame: &FrameRecord) -> Result<FrameTransforms, String> {
    let poses = places.poses(frame)?;
    let mut edges = Vec::new();
    edges.extend(poses.estimate.map(|place| edge(SPS, AUV, &place)));
    edges.extend(poses.truth.map(|place| edge(WORLD, AUV_TRUTH, &place)));
    edges.extend(poses.prior.map(|place| edge(WORLD, AUV_PRIOR, &place)));
    Ok(stamped(edges, frame.stamp_ns))
}

/// The vehicle in one frame, a message a topic.
pub(crate) fn body_pose(places: &Places, frame: &FrameRecord) -> Result<Vec<(&'static str, PoseInFrame)>, String> {
    let poses = places.poses(frame)?;
    let in_frame = |frame_id: &str, pose| PoseInFrame {
        timestamp: Some(timestamp(frame.stamp_ns)),
        frame_id: frame_id.to_owned(),
        pose: Some(pose),
    };
    let mut messages = Vec::new();
    messages.extend(poses.estimate.map(|place| (topic::POSE_ESTIMATE, in_frame(SPS, pose(&place)))));
    messages.extend(poses.truth.map(|place| (topic::POSE_TRUTH, in_frame(WORLD, pose(&place)))));
    messages.extend(poses.prior.map(|place| (topic::POSE_PRIOR, in_frame(WORLD, pose(&place)))));
    Ok(messages)
}
