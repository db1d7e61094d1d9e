//! A frame's message as far as results need it.
//!
//! Most of a frame's numbers are covariances of cloud points and names of points in view, every one of them an allocation.
//! These messages have the fields of `Frame` and its parts under the same tags and leave those out; a decoder skips what
//! it has no field for.

use super::{Malformed, frame_record};
use crate::{FrameRecord, proto};

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
    #[prost(double, repeated, tag = "5")]
    pixels: Vec<f64>,
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
        seen.push(super::frame::pixels(&point.pixels)?);
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
    })?;
    let unknown = [f64::NAN; 3];
    let point = |pixels| crate::CloudPoint { at: unknown, covariance: [unknown; 3], pixels };
    frame.cloud = seen.into_iter().map(point).collect();
    Ok(frame)
}
