//! The cameras.

use crate::{
    proto::foxglove::CameraCalibration,
    record::{CameraRecord, RigRecord},
};

use super::{names::CAMERAS, values::timestamp};

/// The calibrations of both cameras.
///
/// Images are logged as taken, so R is the identity and P is K beside a column. For a rectified rig
/// that column of the right camera is (−fx·baseline, 0, 0), as ROS writes it. For any other rig no
/// such number exists: the column is zero and the extrinsics are the edge `camera_left` →
/// `camera_right` of `/tf`.
pub(crate) fn calibrations(rig: &RigRecord, stamp_ns: u64) -> [CameraCalibration; 2] {
    let baseline = if rig.rectified { -rig.right_from_left[0][3] } else { 0.0 };
    [calibration(&rig.left, CAMERAS[0], 0.0, stamp_ns), calibration(&rig.right, CAMERAS[1], baseline, stamp_ns)]
}

fn calibration(camera: &CameraRecord, frame_id: &str, baseline: f64, stamp_ns: u64) -> CameraCalibration {
    let k = camera.matrix;
    let mut d = camera.distortion.clone();
    let length = match d.len() {
        _ if camera.equidistant => 4,
        0..=5 => 5,
        6..=8 => 8,
        _ => 12,
    };
    d.resize(length, 0.0);
    let mut p: Vec<f64> = k.iter().flat_map(|row| [row[0], row[1], row[2], 0.0]).collect();
    // `0.0 -` rather than a negation: a baseline of zero must not become −0.
    p[3] = 0.0 - k[0][0] * baseline;
    CameraCalibration {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame_id.to_owned(),
        width: camera.size[0],
        height: camera.size[1],
        distortion_model: match d.len() {
            4 => "kannala_brandt",
            5 => "plumb_bob",
            _ => "rational_polynomial",
        }
        .to_owned(),
        d,
        k: k.as_flattened().to_vec(),
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p,
    }
}
