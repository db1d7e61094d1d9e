//! The disparity noise σ_d, measured against ground truth.

use nalgebra::Point3;
use seafix_geometry::{Camera, Pinhole, Point, RightCamera, StereoRig, Transform};
use seafix_log::{CameraRecord, FrameRecord, RigRecord, TargetModel, TrialHeader};

use crate::place::matrix;

/// Maximum distance (px) of both pixels of a correct pair from the true projections.
const CORRECT: f64 = 2.0;

/// Measured minus true disparity (px) of every correctly identified point of `frame`.
///
/// The result is empty without rectified images or ground truth. The errors are truncated, because pairs more than 2 px
/// from the true projection are excluded. Targets with several objects are excluded too: their coordinates include
/// survey errors.
pub(crate) fn errors(header: &TrialHeader, frame: &FrameRecord) -> Vec<f64> {
    let (Some(truth), true) = (&frame.truth, header.rig.rectified) else { return Vec::new() };
    let Some(rig) = rig(&header.rig) else { return Vec::new() };
    let Some(camera_from_world) = matrix(&truth.world_from_camera).try_inverse() else { return Vec::new() };
    let mut errors = Vec::new();
    for target in &frame.targets {
        let model = header.targets.iter().find(|model| model.id == target.object);
        let Some(model) = model.filter(|model| !surveyed(model)) else { continue };
        let Some((_, place)) = truth.world_from_object.iter().find(|(id, _)| *id == target.object) else { continue };
        let camera_from_object = camera_from_world * matrix(place);
        for pair in &target.pairs {
            let [x, y, z] = model.points[pair.model as usize].at;
            let at = camera_from_object.transform_point(&Point3::new(x, y, z));
            let (Some(seen), Some(expected)) =
                (frame.cloud[pair.cloud as usize].pixels, rig.project(&Point::new(at.x, at.y, at.z)))
            else {
                continue;
            };
            let expected = [[expected.left.u, expected.left.v], [expected.right.u, expected.right.v]];
            let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            if apart(seen.left, expected[0]) <= CORRECT && apart(seen.right, expected[1]) <= CORRECT {
                errors.push((seen.left[0] - seen.right[0]) - (expected[0][0] - expected[1][0]));
            }
        }
    }
    errors
}

/// Whether the points of `model`, named `OBJECT/POINT`, belong to several objects joined by a survey.
fn surveyed(model: &TargetModel) -> bool {
    let mut objects = model.points.iter().map(|point| point.id.rsplit_once('/').map(|(object, _)| object));
    let first = objects.next();
    objects.any(|object| Some(object) != first)
}

fn rig(record: &RigRecord) -> Option<StereoRig> {
    let right_from_left = Transform::<RightCamera, Camera>::from_matrix(&matrix(&record.right_from_left)).ok()?;
    StereoRig::new(camera(&record.left)?, camera(&record.right)?, right_from_left).ok()
}

fn camera(record: &CameraRecord) -> Option<Pinhole> {
    let k = record.matrix;
    let new = if record.equidistant { Pinhole::equidistant } else { Pinhole::new };
    new(record.size, [k[0][0], k[1][1]], [k[0][2], k[1][2]], &record.distortion).ok()
}
