//! The points of interest in view.

use super::fields::Malformed;
use crate::{
    proto,
    record::{FrameRecord, PointOfInterest},
};

/// The message of the points of `frame`.
pub(crate) fn inspection_message(frame: &FrameRecord) -> proto::Inspection {
    let point = |point: &PointOfInterest| proto::PointOfInterest {
        object: point.object.clone(),
        point: point.point.clone(),
        at: point.at.to_vec(),
        believed: point.believed.map_or_else(Vec::new, |at| at.to_vec()),
        error: point.error(),
        nees: point.nees,
    };
    proto::Inspection { frame: frame.frame, stamp_ns: frame.stamp_ns, points: frame.poi.iter().map(point).collect() }
}

/// The points that `message` holds.
pub(crate) fn inspection_record(message: proto::Inspection) -> Result<Vec<PointOfInterest>, Malformed> {
    let place = |name: &str, numbers: &[f64]| {
        <[f64; 3]>::try_from(numbers)
            .map_err(|_| Malformed(format!("inspection.{name} has {} numbers instead of 3", numbers.len())))
    };
    let point = |point: proto::PointOfInterest| {
        Ok(PointOfInterest {
            at: place("at", &point.at)?,
            believed: if point.believed.is_empty() { None } else { Some(place("believed", &point.believed)?) },
            object: point.object,
            point: point.point,
            nees: point.nees,
        })
    };
    message.points.into_iter().map(point).collect()
}
