//! A frame's message as far as results need it.
//!
//! Most of a frame's numbers are covariances of cloud points and names of points in view, every one of them an allocation.
//! These messages have the fields of `Frame` and its parts under the same tags and leave those out; a decoder skips what
//! it has no field for.

use prost::bytes::Bytes;

use super::{fields::Malformed, frame::frame_record};
use crate::{
    proto,
    record::{FrameRecord, PixelPair},
};

/// A [`proto::Frame`] without its prior.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct BareFrame {
    #[prost(uint64, tag = "1")]
    frame: u64,
    #[prost(uint64, tag = "2")]
    stamp_ns: u64,
    #[prost(uint32, tag = "3")]
    pub(crate) images: u32,
    #[prost(uint32, tag = "4")]
    pub(crate) results: u32,
    #[prost(double, repeated, tag = "5")]
    key_points: Vec<f64>,
    #[prost(message, repeated, tag = "6")]
    cloud: Vec<BarePoint>,
    #[prost(message, optional, tag = "8")]
    truth: Option<BareTruth>,
    #[prost(message, optional, tag = "9")]
    navigation: Option<proto::Navigation>,
}

/// A [`proto::CloudPoint`] by its pixels alone.
#[derive(Clone, PartialEq, prost::Message)]
struct BarePoint {
    /// The bytes of its four numbers, as they stand in the message: a cloud has many points.
    #[prost(bytes = "bytes", tag = "5")]
    pixels: Bytes,
}

/// A [`proto::Truth`] without the points in view.
#[derive(Clone, PartialEq, prost::Message)]
struct BareTruth {
    #[prost(double, repeated, tag = "1")]
    world_from_camera: Vec<f64>,
    #[prost(message, repeated, tag = "2")]
    objects: Vec<proto::ObjectPose>,
}

/// The frame that `message` holds: no prior, no points in view, and cloud points without places and covariances (NaN).
pub(crate) fn bare_frame_record(message: BareFrame) -> Result<FrameRecord, Malformed> {
    let mut seen = Vec::with_capacity(message.cloud.len());
    for point in &message.cloud {
        seen.push(pixels(&point.pixels)?);
    }
    let truth = message.truth.map(|truth| proto::Truth {
        world_from_camera: truth.world_from_camera,
        objects: truth.objects,
        visible: Vec::new(),
    });
    let mut frame = frame_record(proto::Frame {
        frame: message.frame,
        stamp_ns: message.stamp_ns,
        images: message.images,
        results: message.results,
        key_points: message.key_points,
        cloud: Vec::new(),
        prior: None,
        truth,
        navigation: message.navigation,
        lines: Vec::new(),
    })?;
    let unknown = [f64::NAN; 3];
    let point = |pixels| crate::record::CloudPoint { at: unknown, covariance: [unknown; 3], pixels };
    frame.cloud = seen.into_iter().map(point).collect();
    Ok(frame)
}

/// Where a point was seen, of the bytes of its numbers; none where it comes from no image.
fn pixels(packed: &[u8]) -> Result<Option<PixelPair>, Malformed> {
    match packed.as_chunks() {
        ([], []) => Ok(None),
        ([u, v, ur, vr], []) => {
            let [u, v, ur, vr] = [u, v, ur, vr].map(|number| f64::from_le_bytes(*number));
            Ok(Some(PixelPair { left: [u, v], right: [ur, vr] }))
        }
        _ => Err(Malformed(format!("cloud.pixels has {} bytes instead of 32", packed.len()))),
    }
}
