//! A frame without its images, results and times, which are messages of their own.

use super::{
    fields::{Malformed, flat, matrix},
    line::{line_message, line_record},
    navigation::{navigation_message, navigation_record},
};
use crate::{
    proto,
    record::{CloudPoint, FrameRecord, PixelPair, PriorRecord, TruthRecord, VisiblePoint},
};

/// The message that closes `frame`.
pub(crate) fn frame_message(frame: &FrameRecord) -> proto::Frame {
    proto::Frame {
        frame: frame.frame,
        stamp_ns: frame.stamp_ns,
        images: frame.images.as_ref().map_or(0, |_| 2),
        results: frame.targets.len() as u32,
        key_points: frame.key_points.as_flattened().to_vec(),
        cloud: frame.cloud.iter().map(point_message).collect(),
        prior: frame.prior.as_ref().map(|prior| proto::Prior { world_from_camera: flat(&prior.world_from_camera) }),
        truth: frame.truth.as_ref().map(truth_message),
        navigation: frame.navigation.as_deref().map(navigation_message),
        lines: frame.lines.iter().map(line_message).collect(),
    }
}

fn point_message(point: &CloudPoint) -> proto::CloudPoint {
    let [x, y, z] = point.at;
    let pixels = point.pixels.map(|PixelPair { left, right }| [left, right].as_flattened().to_vec());
    proto::CloudPoint { x, y, z, covariance: flat(&point.covariance), pixels: pixels.unwrap_or_default() }
}

fn truth_message(truth: &TruthRecord) -> proto::Truth {
    let object =
        |(object, pose): &(String, _)| proto::ObjectPose { object: object.clone(), world_from_object: flat(pose) };
    let visible = |seen: &VisiblePoint| proto::VisiblePoint { object: seen.object.clone(), point: seen.point };
    proto::Truth {
        world_from_camera: flat(&truth.world_from_camera),
        objects: truth.world_from_object.iter().map(object).collect(),
        visible: truth.visible.iter().map(visible).collect(),
    }
}

/// The frame that `message` holds, still without images, results and times.
pub(crate) fn frame_record(message: proto::Frame) -> Result<FrameRecord, Malformed> {
    let (key_points, rest) = message.key_points.as_chunks::<2>();
    if !rest.is_empty() {
        return Err(Malformed("key_points has an odd number of coordinates".to_owned()));
    }
    let prior = |prior: proto::Prior| {
        Ok(PriorRecord { world_from_camera: matrix("prior.world_from_camera", &prior.world_from_camera)? })
    };
    Ok(FrameRecord {
        frame: message.frame,
        stamp_ns: message.stamp_ns,
        key_points: key_points.to_vec(),
        cloud: message.cloud.into_iter().map(point_record).collect::<Result<_, _>>()?,
        lines: message.lines.iter().map(line_record).collect::<Result<_, _>>()?,
        prior: message.prior.map(prior).transpose()?,
        truth: message.truth.map(truth_record).transpose()?,
        navigation: message.navigation.map(navigation_record).transpose()?.map(Box::new),
        ..FrameRecord::default()
    })
}

fn point_record(message: proto::CloudPoint) -> Result<CloudPoint, Malformed> {
    let pixels = pixels(&message.pixels)?;
    let covariance = matrix("cloud.covariance", &message.covariance)?;
    Ok(CloudPoint { at: [message.x, message.y, message.z], covariance, pixels })
}

/// Where a point was seen, of its four numbers; none where it comes from no image.
fn pixels(numbers: &[f64]) -> Result<Option<PixelPair>, Malformed> {
    match *numbers {
        [] => Ok(None),
        [u, v, ur, vr] => Ok(Some(PixelPair { left: [u, v], right: [ur, vr] })),
        _ => Err(Malformed(format!("cloud.pixels has {} numbers instead of 4", numbers.len()))),
    }
}

fn truth_record(message: proto::Truth) -> Result<TruthRecord, Malformed> {
    let object =
        |object: proto::ObjectPose| Ok((object.object, matrix("world_from_object", &object.world_from_object)?));
    let visible = |seen: proto::VisiblePoint| VisiblePoint { object: seen.object, point: seen.point };
    Ok(TruthRecord {
        world_from_camera: matrix("truth.world_from_camera", &message.world_from_camera)?,
        world_from_object: message.objects.into_iter().map(object).collect::<Result<_, _>>()?,
        visible: message.visible.into_iter().map(visible).collect(),
    })
}
