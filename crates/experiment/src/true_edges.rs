//! The true places of a target's straight edges.

use nalgebra::{Point2, Vector2};
use seafix_geometry::{Camera, MeasuredLine, Object, Pixel, Point, StereoRig, Transform};
use seafix_referencing::{Correspondence, End, ModelEdge, Target};

use crate::judge::CORRECT_PX;

/// Places on an edge at which its visibility is examined.
const PLACES: usize = 16;
/// Minimum number of these in both images: the overlap of a quarter that identifies an edge.
const MIN_SEEN: usize = PLACES / 4;

/// The edges of a target at their true places.
pub(crate) struct TrueEdges<'a> {
    target: &'a Target,
    rig: &'a StereoRig,
    camera_from_object: Transform<Camera, Object>,
    /// The ends of each edge (camera frame).
    ends: Vec<[Point<Camera>; 2]>,
}

impl<'a> TrueEdges<'a> {
    /// The edges of a target whose points are at these places (camera frame).
    pub(crate) fn of(
        target: &'a Target,
        points: &[Point<Camera>],
        camera_from_object: &Transform<Camera, Object>,
        rig: &'a StereoRig,
    ) -> Self {
        let place = |end: End| match end {
            End::Point(index) => points[index],
            End::At(place) => *camera_from_object * place,
        };
        let ends = target.edges.iter().map(|edge| edge.ends.map(place)).collect();
        Self { target, rig, camera_from_object: *camera_from_object, ends }
    }

    /// The number of edges that face the camera and lie in both images by at least a quarter.
    ///
    /// Bodies between camera and edge are not considered: a site does not describe them.
    pub(crate) fn visible(&self) -> u32 {
        let camera = self.camera_from_object.inverse().translation();
        let seen = |edge: &ModelEdge, [from, to]: &[Point<Camera>; 2]| {
            let along = *to - *from;
            let places = (0..PLACES).map(|k| *from + along * ((k as f64 + 0.5) / PLACES as f64));
            let faces = edge.faces.is_empty() || edge.shows_itself(&self.target.points, &camera);
            faces && places.filter(|place| self.rig.sees(place, 0.0).is_some()).count() >= MIN_SEEN
        };
        self.target.edges.iter().zip(&self.ends).filter(|(edge, ends)| seen(edge, ends)).count() as u32
    }

    /// The number of identified edges whose measured line lies within 2 px of the true edge at both ends, in both
    /// images.
    pub(crate) fn correct(&self, identified: &[Correspondence], lines: &[MeasuredLine]) -> u32 {
        identified.iter().filter(|pair| self.holds(pair.model, &lines[pair.cloud]) == Some(true)).count() as u32
    }

    /// `None` if the edge or the line has no projection.
    fn holds(&self, edge: usize, line: &MeasuredLine) -> Option<bool> {
        let [from, to] = self.ends[edge];
        let (from, to) = (self.rig.project(&from)?, self.rig.project(&to)?);
        let measured = match &line.segments {
            Some(segments) => [segments.left, segments.right].map(|segment| segment.map(|offset| offset.at)),
            None => {
                let [a, b] = line.ends.each_ref().map(|end| self.rig.project(end));
                let (a, b) = (a?, b?);
                [[a.left, b.left], [a.right, b.right]]
            }
        };
        let near = |true_ends: [Pixel; 2], places: [Pixel; 2]| places.iter().all(|at| off(true_ends, at) <= CORRECT_PX);
        Some(near([from.left, to.left], measured[0]) && near([from.right, to.right], measured[1]))
    }
}

/// The distance (px) of a place from the line through two pixels.
fn off([from, to]: [Pixel; 2], at: &Pixel) -> f64 {
    let point = |pixel: &Pixel| Point2::new(pixel.u, pixel.v);
    let (along, step): (Vector2<f64>, Vector2<f64>) = (point(&to) - point(&from), point(at) - point(&from));
    along.perp(&step).abs() / along.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_from_a_line_ignores_its_ends() {
        let pixel = |u: f64, v: f64| Pixel { u, v };
        assert!((off([pixel(0.0, 0.0), pixel(3.0, 4.0)], &pixel(30.0, 42.5)) - 1.5).abs() < 1e-12);
    }
}
