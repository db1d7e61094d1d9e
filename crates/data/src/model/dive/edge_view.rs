//! The lines of one adjusted pair.

use nalgebra::Vector3;
use seafix_geometry::{Camera, MeasuredLine, Object, Point, StereoRig, Transform};
use seafix_referencing::SpaceLine;

use super::expect::MARGIN;

/// An adjusted pair with its measured lines.
pub(super) struct View {
    /// The index of the pair.
    pub(super) pair: usize,
    /// The pose of the object.
    pub(super) camera_from_object: Transform<Camera, Object>,
    /// The lines in the camera's frame, and whether their depth is measured.
    pub(super) lines: Vec<(SpaceLine, bool)>,
    object_from_camera: Transform<Object, Camera>,
}

impl View {
    pub(super) fn new(pair: usize, object_from_camera: Transform<Object, Camera>, lines: &[MeasuredLine]) -> Self {
        let lines = lines.iter().filter_map(|line| Some((SpaceLine::of(line)?, line.depth))).collect();
        Self { pair, camera_from_object: object_from_camera.inverse(), lines, object_from_camera }
    }

    /// The ends of a line, object frame.
    pub(super) fn ends(&self, line: &SpaceLine) -> [Vector3<f64>; 2] {
        line.ends.map(|end| (self.object_from_camera * Point::from(end)).coords)
    }

    /// Whether the left image has room for both ends (object frame).
    pub(super) fn shows(&self, ends: &[Vector3<f64>; 2], rig: &StereoRig) -> bool {
        let seen = |end: &Vector3<f64>| {
            let here = self.camera_from_object * Point::from(*end);
            here.coords.z > 0.0 && rig.sees(&here, MARGIN).is_some()
        };
        seen(&ends[0]) && seen(&ends[1])
    }

    /// The direction from the middle of an edge to the camera, without the part along the edge.
    pub(super) fn ray_across(&self, [from, to]: &[Vector3<f64>; 2]) -> Vector3<f64> {
        let ray = self.object_from_camera.translation() - (from + to) / 2.0;
        let direction = (to - from).normalize();
        ray - direction * direction.dot(&ray)
    }
}
