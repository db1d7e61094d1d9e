//! Poses and prior poses.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use seafix_geometry::{Camera, Object, Point, Transform};

use super::problem::GeneratedPrior;
use crate::stream::Stream;

/// Maximum number of prior poses that are tried; the last is kept although a point may lie outside of its gate.
const MAX_TRIES: usize = 1000;

/// A uniform random rotation: four normal numbers, normalised.
pub(super) fn rotation(stream: &mut Stream) -> UnitQuaternion<f64> {
    let [w, i, j, k] = std::array::from_fn(|_| stream.normal());
    UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k))
}

/// A uniform random direction.
pub(super) fn direction(stream: &mut Stream) -> Vector3<f64> {
    stream.normal3(1.0).normalize()
}

/// A uniform point in the cube with this half-size.
pub(super) fn cube(stream: &mut Stream, half: f64) -> Vector3<f64> {
    let [x, y, z] = std::array::from_fn(|_| stream.between(-half, half));
    Vector3::new(x, y, z)
}

/// A random pose of the object at this distance, at most 0.5 m off the optical axis on each axis.
pub(super) fn ahead(stream: &mut Stream, distance: f64) -> Transform<Camera, Object> {
    let rotation = rotation(stream);
    let off = cube(stream, 0.5);
    Transform::new(rotation, Vector3::new(off.x, off.y, distance))
}

/// A prior pose under which every measured point (`seen`: object frame, camera frame) lies in its gate.
///
/// The true pose is rotated about the model's centroid by up to 0.6 s divided by the model's radius, and displaced by
/// up to `shift`·s along each camera axis; s is the gate's half-size.
pub(super) fn prior_pose(
    stream: &mut Stream,
    truth: &Transform<Camera, Object>,
    model: &[Vector3<f64>],
    seen: &[(Vector3<f64>, Vector3<f64>)],
    gate: f64,
    shift: f64,
) -> (Transform<Camera, Object>, GeneratedPrior) {
    let centre = model.iter().sum::<Vector3<f64>>() / model.len() as f64;
    let radius = model.iter().map(|at| (at - centre).norm()).fold(0.0, f64::max);
    let mut tries = 0;
    loop {
        let turn = direction(stream) * stream.between(0.0, 0.6 * gate / radius);
        let turned = UnitQuaternion::from_scaled_axis(turn) * truth.rotation();
        let moved = (*truth * Point::from(centre)).coords + cube(stream, shift * gate);
        let prior_pose = Transform::new(turned, moved - turned * centre);
        tries += 1;
        let inside = |(at, measured): &(Vector3<f64>, Vector3<f64>)| {
            ((prior_pose * Point::from(*at)).coords - measured).amax() <= gate - 1e-6
        };
        if tries == MAX_TRIES || seen.iter().all(inside) {
            return (prior_pose, GeneratedPrior { t_cam_obj: prior_pose.rows(), shell_half_m: gate });
        }
    }
}
