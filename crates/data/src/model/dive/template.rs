//! The neighbourhood of a feature in a left image, kept to recognise it in others.

use nalgebra::{Matrix2, Vector2};
use seafix_geometry::{Camera, Pixel, Point, StereoRig, Transform};
use seafix_vision::{Expected, Image};

use super::picture::cut;

/// A square of pixels around a feature.
#[derive(Debug, Clone)]
pub(super) struct Template {
    /// The pair it was taken from.
    pub(super) pair: usize,
    /// The pixels.
    pub(super) image: Image,
    /// The feature's position in [`image`](Self::image).
    place: Pixel,
    /// The feature's position in the left image.
    at: Pixel,
}

/// The half side of the square (px): half of the largest window of an alignment, its reach, and the spline's margin.
const HALF: usize = 20;
/// The distance (px) over which the relation of two images is differentiated.
const STEP: f64 = 4.0;

impl Template {
    /// The neighbourhood of `at` in the left image of a pair; `None` outside the image.
    pub(super) fn cut(pair: usize, left: &Image, at: Pixel) -> Option<Self> {
        let (image, place) = cut(left, at, HALF)?;
        Some(Self { pair, image, place, at })
    }

    /// The expected appearance in the left image of a pair at `there_from_here`, at the position `start`.
    ///
    /// `here` is the feature in the camera of the template. Its surface is taken as parallel to the template's image.
    pub(super) fn expected(
        &self,
        rig: &StereoRig,
        here: &Point<Camera>,
        there_from_here: &Transform<Camera, Camera>,
        start: Pixel,
    ) -> Option<Expected> {
        let seen = |u: f64, v: f64, depth: f64| {
            let ray = rig.left().normalize(&Pixel { u: self.at.u + u, v: self.at.v + v })?;
            let there = rig.left().project(&(*there_from_here * Point::<Camera>::from(ray.push(1.0) * depth)))?;
            Some(Vector2::new(there.u, there.v))
        };
        let depth = here.coords.z;
        let across = (seen(STEP, 0.0, depth)? - seen(-STEP, 0.0, depth)?) / (2.0 * STEP);
        let down = (seen(0.0, STEP, depth)? - seen(0.0, -STEP, depth)?) / (2.0 * STEP);
        let shape = Matrix2::from_columns(&[across, down]);
        let deeper = seen(0.0, 0.0, 1.01 * depth)? - seen(0.0, 0.0, depth)?;
        // Without parallax depth moves nothing, and any direction serves.
        let along = (shape.try_inverse()? * deeper).try_normalize(1e-9).unwrap_or_else(Vector2::x);
        Some(Expected { place: self.place, start, shape, along })
    }
}
