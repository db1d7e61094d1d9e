//! Points in space.

use std::collections::BTreeSet;

use crate::{
    proto::foxglove::{PackedElementField, PointCloud, Pose, Quaternion, Vector3, packed_element_field::NumericType},
    record::{FrameRecord, TrialHeader},
};

use super::{
    names::{CAMERAS, SPS},
    rigid::Places,
    values::{colour, timestamp},
};

/// Three coordinates, one number that tells points apart, and a colour.
pub(super) struct Dot {
    pub(super) at: [f64; 3],
    pub(super) number: u32,
    pub(super) colour: [u8; 3],
}

const STRIDE: u32 = 20;

/// A cloud in a coordinate frame; `number` names what tells its points apart.
pub(super) fn cloud(frame_id: &str, number: &str, dots: impl IntoIterator<Item = Dot>, stamp_ns: u64) -> PointCloud {
    let field = |name: &str, offset, kind: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind.into(),
    };
    let mut data = Vec::new();
    for dot in dots {
        dot.at.iter().for_each(|x| data.extend((*x as f32).to_le_bytes()));
        data.extend(dot.number.to_le_bytes());
        data.extend(dot.colour);
        data.push(255);
    }
    PointCloud {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame_id.to_owned(),
        pose: Some(Pose {
            position: Some(Vector3 { x: 0.0, y: 0.0, z: 0.0 }),
            orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        }),
        point_stride: STRIDE,
        fields: vec![
            field("x", 0, NumericType::Float32),
            field("y", 4, NumericType::Float32),
            field("z", 8, NumericType::Float32),
            field(number, 12, NumericType::Uint32),
            field("red", 16, NumericType::Uint8),
            field("green", 17, NumericType::Uint8),
            field("blue", 18, NumericType::Uint8),
            field("alpha", 19, NumericType::Uint8),
        ],
        data: data.into(),
    }
}

/// All triangulated points, grey.
pub(crate) fn measured_cloud(frame: &FrameRecord) -> PointCloud {
    let dots = frame.cloud.iter().zip(0..).map(|(point, number)| Dot { at: point.at, number, colour: [170; 3] });
    cloud(CAMERAS[0], "cloud_index", dots, frame.stamp_ns)
}

/// The points that are a candidate of some model point, white.
pub(crate) fn candidate_cloud(frame: &FrameRecord) -> PointCloud {
    let numbers: BTreeSet<u32> = frame.targets.iter().flat_map(|target| target.candidates.concat()).collect();
    let dot = |number: u32| Dot { at: frame.cloud[number as usize].at, number, colour: [255; 3] };
    cloud(CAMERAS[0], "cloud_index", numbers.into_iter().map(dot), frame.stamp_ns)
}

/// The identified points, in the colours of their targets.
pub(crate) fn identified_cloud(header: &TrialHeader, frame: &FrameRecord) -> PointCloud {
    let dots = frame.targets.iter().flat_map(|target| {
        let index = header.targets.iter().position(|model| model.id == target.object).unwrap_or_default();
        target.pairs.iter().map(move |pair| Dot {
            at: frame.cloud[pair.cloud as usize].at,
            number: pair.model,
            colour: colour(index),
        })
    });
    cloud(CAMERAS[0], "model_index", dots, frame.stamp_ns)
}

/// The model's points in the site's frame, in the colours of their targets; without the targets whose
/// place there is not known.
pub(crate) fn model_cloud(header: &TrialHeader, places: &Places, stamp_ns: u64) -> PointCloud {
    let placed = header.targets.iter().enumerate();
    let placed = placed.filter_map(|(index, target)| Some((index, target, places.of_target(&target.id)?)));
    let dots = placed.flat_map(|(index, target, place)| {
        target.points.iter().zip(0..).map(move |(point, number)| Dot {
            at: (*place * seafix_geometry::Point::new(point.at[0], point.at[1], point.at[2])).coords.into(),
            number,
            colour: colour(index),
        })
    });
    cloud(SPS, "model_index", dots, stamp_ns)
}
