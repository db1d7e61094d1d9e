//! Pyramidal tracking of points from one image to another.

mod pyramid;

use nalgebra::{Matrix2, Vector2};
pub use pyramid::Pyramid;
use seafix_component::{Settings, in_range};
use seafix_geometry::Pixel;
use serde::{Deserialize, Serialize};

use crate::{
    align::{
        inverse_compositional::{Aligned, Aligner, Rules},
        warp::Translation,
        window::Weight,
    },
    image::Image,
    workspace::Workspace,
};

/// The pyramidal Lucas–Kanade tracker with forward–backward check.
///
/// On each pyramid level, the coarsest first, the window around the point is aligned to the other image by translation,
/// as in [`Direct`](crate::Direct); each level begins at the result of the one before. A track is accepted if the
/// finest level aligns and tracking backward returns to the start.
///
/// Source: Bouguet, *Pyramidal implementation of the Lucas Kanade feature tracker*, 2000; Kalal, Mikolajczyk and Matas,
/// *Forward-backward error*, 2010.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Tracker {
    /// Side of the window on each level (px); odd, 3 to 201.
    pub window: usize,
    /// Weights of the window's pixels.
    pub weight: Weight,
    /// Number of pyramid levels, 1 to 12; each doubles the reach.
    pub levels: usize,
    /// Maximum motion of a point on one level (px of that level).
    pub reach: f64,
    /// Minimum zero-normalised cross-correlation of the windows on the finest level.
    pub min_correlation: f64,
    /// Maximum forward–backward error (px); 0 disables the check.
    pub return_px: f64,
    /// Maximum number of iterations on a level.
    pub iterations: usize,
}

/// A tracked point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// The position in the other image.
    pub at: Pixel,
    /// The covariance of that position, given the position in the first image (px²).
    pub covariance: Matrix2<f64>,
    /// The zero-normalised cross-correlation of the windows.
    pub correlation: f64,
}

impl From<Aligned> for Track {
    fn from(aligned: Aligned) -> Self {
        let Aligned { at, shape: _, covariance, correlation } = aligned;
        Self { at: Pixel { u: at.x, v: at.y }, covariance, correlation }
    }
}

impl Default for Tracker {
    fn default() -> Self {
        Self {
            window: 15,
            weight: Weight::Gaussian,
            levels: 5,
            reach: 8.0,
            min_correlation: 0.8,
            return_px: 0.5,
            iterations: 20,
        }
    }
}

/// The number of points in a piece of the work.
const PIECE: usize = 64;
/// The step length (px of the level) that ends the iteration on intermediate levels.
const COARSE: f64 = 0.03;
/// The minimum correlation on intermediate levels.
const ALIKE: f64 = 0.5;

impl Tracker {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The invalid setting, its value and its range.
    pub fn check(&self) -> Result<(), String> {
        let Self { window, weight: _, levels, reach, min_correlation, return_px, iterations } = *self;
        let odd = window % 2 == 1 && (3..=201).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 3 to 201")?;
        in_range((1..=12).contains(&levels), "levels", levels, "a number from 1 to 12")?;
        in_range(reach > 0.0 && reach <= 100.0, "reach", reach, "more than 0, at most 100 (px)")?;
        let correlated = (-1.0..=1.0).contains(&min_correlation);
        in_range(correlated, "min-correlation", min_correlation, "a number from -1 to 1")?;
        in_range((0.0..=100.0).contains(&return_px), "return-px", return_px, "a number from 0 to 100 (px)")?;
        in_range((1..=1000).contains(&iterations), "iterations", iterations, "a number from 1 to 1000")
    }

    /// Replaces `found` by the positions in the second image of `places`: positions in the first image and initial
    /// positions in the second.
    pub fn track_into(
        &self,
        [from, to]: [&Pyramid; 2],
        places: &[[Pixel; 2]],
        work: &mut Workspace,
        found: &mut Vec<Option<Track>>,
    ) {
        found.clear();
        found.resize(places.len(), None);
        let threads = work.threads();
        let aligners = work.get::<Vec<Aligner>>();
        threads.pieces(found, PIECE, aligners, |index, piece, aligner| {
            for (found, [place, start]) in piece.iter_mut().zip(&places[index * PIECE..]) {
                *found = self.track([from.levels(), to.levels()], place, start, aligner);
            }
        });
    }

    /// The tracks of `places` from the first image to the second, from the same initial pixels.
    pub fn track_all(&self, from: &Image, to: &Image, places: &[Pixel]) -> Vec<Option<Track>> {
        let pyramids = [from, to].map(|image| Pyramid::new(image, self.levels));
        let places: Vec<[Pixel; 2]> = places.iter().map(|place| [*place; 2]).collect();
        let mut found = Vec::new();
        self.track_into([&pyramids[0], &pyramids[1]], &places, &mut Workspace::default(), &mut found);
        found
    }

    /// The acceptance rules of an alignment on the finest level.
    pub(crate) fn rules(&self) -> Rules {
        let Self { window, weight, reach, min_correlation, iterations, .. } = *self;
        Rules { window, weight, reach, min_correlation, iterations, precision: Rules::FINE, beyond: false }
    }

    /// Tracks one point forward and backward.
    pub(crate) fn track(
        &self,
        [from, to]: [&[Image]; 2],
        place: &Pixel,
        start: &Pixel,
        aligner: &mut Aligner,
    ) -> Option<Track> {
        let there = self.there([from, to], place, start, aligner)?;
        self.returns([from, to], [place, start], &there, aligner).then_some(there)
    }

    /// Tracks one point forward.
    pub(crate) fn there(
        &self,
        levels: [&[Image]; 2],
        place: &Pixel,
        start: &Pixel,
        aligner: &mut Aligner,
    ) -> Option<Track> {
        self.follow(levels, &vector(place), &vector(start), aligner).map(Track::from)
    }

    /// Whether backward tracking, with an initial error as large as the forward one, returns to `place`.
    pub(crate) fn returns(
        &self,
        [from, to]: [&[Image]; 2],
        [place, start]: [&Pixel; 2],
        there: &Track,
        aligner: &mut Aligner,
    ) -> bool {
        let [place, start, there] = [place, start, &there.at].map(vector);
        self.return_px == 0.0
            || self
                .follow([to, from], &there, &(there + place - start), aligner)
                .is_some_and(|back| (back.at - place).norm() <= self.return_px)
    }

    /// Tracks from the coarsest level to the finest; a level that fails to align passes its initial position on.
    fn follow(
        &self,
        [from, to]: [&[Image]; 2],
        place: &Vector2<f64>,
        start: &Vector2<f64>,
        aligner: &mut Aligner,
    ) -> Option<Aligned> {
        let fine = self.rules();
        let coarse = Rules { min_correlation: ALIKE, precision: COARSE, beyond: true, ..fine };
        let mut at = *start;
        let levels = from.iter().zip(to).enumerate();
        for (level, (from, to)) in levels.skip(1).rev() {
            let scale = (1_u32 << level) as f64;
            let begin = (&(at / scale), &Matrix2::identity());
            if let Some(found) = aligner.align(from, to, &(place / scale), begin, &coarse, &Translation) {
                at = found.at * scale;
            }
        }
        let (from, to) = (from.first()?, to.first()?);
        aligner.align(from, to, place, (&at, &Matrix2::identity()), &fine, &Translation)
    }
}

fn vector(pixel: &Pixel) -> Vector2<f64> {
    Vector2::new(pixel.u, pixel.v)
}

/// An image of `width` × ¾ `width` of soft discs of random size, position and brightness, moved by `shift`.
#[cfg(test)]
pub(crate) fn stones(width: usize, shift: [f64; 2]) -> Image {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let height = width * 3 / 4;
    let mut pixels = vec![100.0_f32; width * height];
    for _ in 0..width * width / 30 {
        let [x, y] = [0, 1].map(|i| 1.4 * width as f64 * random() - 0.2 * width as f64 + shift[i]);
        let (radius, bright) = (2.0 + 8.0 * random(), 60.0 * random() - 30.0);
        let around =
            |x: f64, n: usize| (x - radius - 6.0).max(0.0) as usize..((x + radius + 7.0).max(0.0) as usize).min(n);
        for v in around(y, height) {
            for u in around(x, width) {
                let off = ((u as f64 - x).powi(2) + (v as f64 - y).powi(2)).sqrt() - radius;
                pixels[v * width + u] += (bright / (1.0 + libm::exp(1.5 * off))) as f32;
            }
        }
    }
    Image::new(width, height, pixels).unwrap()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIFT: [f64; 2] = [31.3, -6.6];

    /// A grid of 48 points well inside an image of 480 px.
    fn places() -> Vec<Pixel> {
        (0..48).map(|i| Pixel { u: 130.5 + 20.0 * (i % 8) as f64, v: 110.25 + 22.0 * (i / 8) as f64 }).collect()
    }

    fn moved(place: &Pixel) -> Pixel {
        Pixel { u: place.u + SHIFT[0], v: place.v + SHIFT[1] }
    }

    #[test]
    fn a_far_shift_is_followed() {
        let (from, to, places) = (stones(480, [0.0; 2]), stones(480, SHIFT), places());
        let right = |tracker: &Tracker| {
            let found = tracker.track_all(&from, &to, &places);
            let errors =
                places.iter().zip(&found).filter_map(|(place, track)| Some(track.as_ref()?.at.distance(&moved(place))));
            let errors: Vec<f64> = errors.collect();
            (errors.len(), errors.iter().filter(|error| **error < 0.05).count())
        };
        let (followed, rightly) = right(&Tracker::default());
        assert!(followed >= 46 && rightly == followed, "{rightly} of {followed} of 48");
        assert_eq!(right(&Tracker { levels: 1, ..Tracker::default() }).1, 0, "one level tracks 31 px");
    }

    #[test]
    fn what_is_gone_is_not_followed() {
        let (from, places) = (stones(240, [0.0; 2]), [Pixel { u: 120.0, v: 90.0 }]);
        let flat = Image::new(240, 180, vec![100.0; 240 * 180]).unwrap();
        assert_eq!(Tracker::default().track_all(&from, &flat, &places), [None]);
        let tiny = Image::new(1, 1, vec![100.0]).unwrap();
        assert_eq!(Tracker::default().track_all(&tiny, &from, &places), [None]);
        assert_eq!(Tracker::default().track_all(&from, &tiny, &places), [None]);
    }

    #[test]
    fn the_path_back_must_end_where_it_began() {
        let images = [[0.0; 2], SHIFT].map(|shift| Pyramid::new(&stones(480, shift), 5));
        let levels = [images[0].levels(), images[1].levels()];
        let (tracker, aligner) = (Tracker::default(), &mut Aligner::default());
        let place = Pixel { u: 210.5, v: 150.25 };
        let there = tracker.there(levels, &place, &place, aligner).unwrap();
        assert!(tracker.returns(levels, [&place, &place], &there, aligner));
        let beside = Track { at: Pixel { u: there.at.u + 1.0, v: there.at.v }, ..there };
        assert!(!tracker.returns(levels, [&place, &place], &beside, aligner), "an error of one pixel passes the check");
        let free = Tracker { return_px: 0.0, ..tracker };
        assert!(free.returns(levels, [&place, &place], &beside, aligner));
    }
}
