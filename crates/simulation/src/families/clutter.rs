//! Distributions of clutter points.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Point, Transform};

use super::prior::cube;
use crate::stream::Stream;

/// Standard deviation of a point from its edge on each axis (m).
pub(super) const EDGE_JITTER: f64 = 0.02;
/// Standard deviation of the floor's height (m).
const FLOOR_RELIEF: f64 = 0.05;

/// The scene about a box that stands on a floor.
pub(super) struct Scene<'a> {
    pub(super) camera_from_object: &'a Transform<Camera, Object>,
    /// Half extents of the box along its axes (m).
    pub(super) half: Vector3<f64>,
    /// Margin of the scene about the object (m).
    pub(super) margin: f64,
    /// The model points in the camera frame.
    pub(super) placed: &'a [Vector3<f64>],
}

impl Scene<'_> {
    /// A clutter point: half lie anywhere, a quarter on the box's edges, a quarter on the floor about it.
    pub(super) fn clutter(&self, stream: &mut Stream) -> Vector3<f64> {
        match stream.below(4) {
            0 => self.edge(stream),
            1 => {
                let [x, y] = [0, 1].map(|k| stream.between(-1.0, 1.0) * (self.half[k] + self.margin));
                self.place(Vector3::new(x, y, -self.half.z + FLOOR_RELIEF * stream.normal()))
            }
            _ => anywhere(stream, self.placed, self.margin),
        }
    }

    /// A clutter point on an edge of the box.
    pub(super) fn edge(&self, stream: &mut Stream) -> Vector3<f64> {
        self.place(on_edge(stream, &self.half) + stream.normal3(EDGE_JITTER))
    }

    fn place(&self, at: Vector3<f64>) -> Vector3<f64> {
        (*self.camera_from_object * Point::from(at)).coords
    }
}

/// A uniform point in the bounding box of `placed` along the camera's axes, extended by `margin`.
pub(super) fn anywhere(stream: &mut Stream, placed: &[Vector3<f64>], margin: f64) -> Vector3<f64> {
    Vector3::from_fn(|k, _| {
        let (low, high) = placed.iter().fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at[k]), high.max(at[k])));
        stream.between(low - margin, high + margin)
    })
}

/// A uniform point in the gate of a random model point.
pub(super) fn in_gates(stream: &mut Stream, predicted: &[Vector3<f64>], half: f64) -> Vector3<f64> {
    predicted[stream.below(predicted.len())] + cube(stream, half)
}

/// A point on a random edge of the box.
pub(super) fn on_edge(stream: &mut Stream, half: &Vector3<f64>) -> Vector3<f64> {
    let along = stream.below(3);
    on_box(stream, half, |axis| axis == along)
}

/// A point on a random face of the box.
pub(super) fn on_face(stream: &mut Stream, half: &Vector3<f64>) -> Vector3<f64> {
    let across = stream.below(3);
    on_box(stream, half, |axis| axis != across)
}

/// A point uniform along the `free` axes, and on a random side along the others.
fn on_box(stream: &mut Stream, half: &Vector3<f64>, free: impl Fn(usize) -> bool) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let at = stream.between(-1.0, 1.0);
        half[axis] * if free(axis) { at } else { at.signum() }
    })
}
