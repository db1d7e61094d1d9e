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
    /// `None` if it is not in view, or is seen from behind: a surface does not show its mirror image.
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
        if shape.determinant() <= 0.0 {
            return None;
        }
        let deeper = seen(0.0, 0.0, 1.01 * depth)? - seen(0.0, 0.0, depth)?;
        // Without parallax depth moves nothing, and any direction serves.
        let along = (shape.try_inverse()? * deeper).try_normalize(1e-9).unwrap_or_else(Vector2::x);
        Some(Expected { place: self.place, start, shape, along })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::adjust::tests::rig;
    use nalgebra::Vector3;

    /// A surface that is turned by more than a quarter shows its back.
    #[test]
    fn a_surface_is_not_seen_from_behind() {
        let rig = rig(0.2);
        let [u, v] = rig.left().principal();
        let at = Pixel { u, v };
        let [width, height] = rig.left().size().map(|side| side as usize);
        let template = Template::cut(0, &Image::new(width, height, vec![0.0; width * height]).unwrap(), at).unwrap();
        let here = Point::<Camera>::new(0.0, 0.0, 2.0);
        for (turn, seen) in [(0.0, true), (1.0, true), (2.2, false), (3.1, false)] {
            // About the vertical through the feature.
            let there_from_here = Transform::<Camera, Camera>::exp(&[0.0, turn, 0.0, 0.0, 0.0, 0.0].into());
            let centre = there_from_here * here;
            let moved = Transform::new(there_from_here.rotation(), Vector3::new(0.0, 0.0, 2.0) - centre.coords);
            assert_eq!(template.expected(&rig, &here, &moved, at).is_some(), seen, "{turn}");
        }
    }
}
