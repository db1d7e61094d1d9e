//! Alignment of points between two images with a known approximate relation.

use nalgebra::{Matrix2, Vector2};
use seafix_geometry::Pixel;

use super::{
    direct::Direct,
    inverse_compositional::{Aligned, Aligner, Rules},
    warp::{Affine, Slanted, Translation, Warp},
};
use crate::{image::Image, track::Track, workspace::Workspace};

/// A point of one image with its expected position in another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// The position in the first image.
    pub place: Pixel,
    /// The expected position in the second image.
    pub start: Pixel,
    /// The derivative of the second image's pixels by those of the first around it.
    pub shape: Matrix2<f64>,
    /// The direction of motion with depth in the second image, in pixels of the first; of unit length.
    ///
    /// Only [`Warp::Slanted`] uses it.
    pub along: Vector2<f64>,
}

#[derive(Debug, Default)]
struct Memory {
    aligners: Vec<Aligner>,
}

/// The number of points in a piece of the work.
const PIECE: usize = 32;

impl Direct {
    /// Replaces `found` by the positions in `to` of the `expected` points of `from`, in order.
    ///
    /// `None` marks a point that is not visible or does not align. The alignment is that of a stereo pair with a given
    /// relation of the images instead of a rig. One template is aligned to image after image, so a point does not
    /// drift.
    pub fn follow_into(
        &self,
        from: &Image,
        to: &Image,
        expected: &[Expected],
        work: &mut Workspace,
        found: &mut Vec<Option<Track>>,
    ) {
        found.clear();
        found.resize(expected.len(), None);
        let threads = work.threads();
        let Memory { aligners } = work.get();
        threads.pieces(found, PIECE, aligners, |index, piece, aligner| {
            for (found, expected) in piece.iter_mut().zip(&expected[index * PIECE..]) {
                *found = self.follow(from, to, expected, aligner);
            }
        });
    }

    fn follow(&self, from: &Image, to: &Image, expected: &Expected, aligner: &mut Aligner) -> Option<Track> {
        self.overlay(from, to, expected, aligner).map(Track::from)
    }

    /// Aligns the window around the point to the second image with these settings.
    pub(super) fn overlay(
        &self,
        from: &Image,
        to: &Image,
        expected: &Expected,
        aligner: &mut Aligner,
    ) -> Option<Aligned> {
        let Self { window, weight, warp, reach, min_correlation, iterations, .. } = *self;
        let rules = Rules { window, weight, reach, min_correlation, iterations, precision: Rules::FINE, beyond: false };
        let vector = |pixel: &Pixel| Vector2::new(pixel.u, pixel.v);
        let (place, start) = (vector(&expected.place), vector(&expected.start));
        let begin = (&start, &expected.shape);
        match warp {
            Warp::Translation => aligner.align(from, to, &place, begin, &rules, &Translation),
            Warp::Slanted => aligner.align(from, to, &place, begin, &rules, &Slanted(expected.along)),
            Warp::AsSeen => aligner.align_as_seen(from, to, &place, begin, &rules, &Slanted(expected.along)),
            Warp::Affine => aligner.align(from, to, &place, begin, &rules, &Affine),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::stones;

    #[test]
    fn a_place_seen_larger_is_found_where_its_neighbourhood_is_expected_larger() {
        // The second image shows the first at 1.25 times the size about (120, 90).
        let from = stones(240, [0.0; 2]);
        let scale = 1.25;
        let centre = [120.0, 90.0];
        let value = |x: f64, y: f64| {
            let (x, y) = (centre[0] + (x - centre[0]) / scale, centre[1] + (y - centre[1]) / scale);
            let (i, j) = (x.floor() as usize, y.floor() as usize);
            let (a, b) = (x - x.floor(), y - y.floor());
            let at = |i: usize, j: usize| f64::from(from.row(j)[i]);
            (1.0 - a) * ((1.0 - b) * at(i, j) + b * at(i, j + 1))
                + a * ((1.0 - b) * at(i + 1, j) + b * at(i + 1, j + 1))
        };
        let pixels = (0..240 * 180).map(|i| value((i % 240) as f64, (i / 240) as f64) as f32).collect();
        let to = Image::new(240, 180, pixels).unwrap();
        let truth =
            |p: &Pixel| Pixel { u: centre[0] + scale * (p.u - centre[0]), v: centre[1] + scale * (p.v - centre[1]) };
        let refine = Direct { window: 15, reach: 3.0, ..Direct::default() };
        let errors = |shape: Matrix2<f64>| {
            let places: Vec<Pixel> = (0..30)
                .map(|i| Pixel { u: 70.5 + 20.0 * f64::from(i % 6), v: 50.25 + 20.0 * f64::from(i / 6) })
                .collect();
            let expected: Vec<Expected> = places
                .iter()
                .map(|place| {
                    let there = truth(place);
                    Expected {
                        place: *place,
                        start: Pixel { u: there.u + 1.0, v: there.v - 0.8 },
                        shape,
                        along: Vector2::x(),
                    }
                })
                .collect();
            let mut found = Vec::new();
            refine.follow_into(&from, &to, &expected, &mut Workspace::default(), &mut found);
            let errors = places.iter().zip(&found).filter_map(|(p, t)| Some(t.as_ref()?.at.distance(&truth(p))));
            errors.collect::<Vec<f64>>()
        };
        let known = errors(Matrix2::identity() * scale);
        assert!(known.len() >= 28 && known.iter().all(|error| *error < 0.1), "{known:?}");
        let unknown = errors(Matrix2::identity());
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        assert!(mean(&unknown) > 2.0 * mean(&known), "{unknown:?}");
    }
}
