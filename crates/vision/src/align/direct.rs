//! Direct alignment of the two views.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{StereoPixels, StereoRig, UncertainPixels};
use serde::{Deserialize, Serialize};

use super::{
    follow::Expected,
    inverse_compositional::{Aligned, Aligner},
    local::Local,
    refinement::{Refinement, Unaligned, apart, together},
    warp::Warp,
    window::Weight,
};
use crate::{image::Image, locate::Pair, workspace::Workspace};

/// Direct alignment of a match by inverse-compositional Gauss–Newton, with its covariance.
///
/// Depth depends on the disparity, so the right pixel is aligned to the left one. The map W(x) = c + A x takes the
/// window T around the left pixel to the right image I and minimises Σ w (Ĩ(W(x)) − T̃(x))². The tilde means: mean
/// subtracted, scaled to unit variance; so the zero-normalised cross-correlation is maximised. The right pixel becomes
/// c. A begins as the relation on a surface parallel to the left image and is kept or fitted ([`Warp`]). The
/// derivatives are those of T, computed once at integer pixels, so that their noise has no preferred direction; a cubic
/// spline interpolates I.
///
/// The error of the left pixel is common to both images; only the alignment's error, which follows from the gradients
/// and the residual, comes between them ([`UncertainPixels`]).
///
/// An alignment fails if it does not converge, ends far from its start, leaves dissimilar windows, or has a standard
/// deviation above `reach`. Most such pairs are false matches: they are rejected, or keep the detectors' positions with
/// independent errors ([`Unaligned`]).
///
/// Source: Baker and Matthews, *Lucas–Kanade 20 years on*, IJCV 2004; interpolation: Unser, *Splines: a perfect fit for
/// signal and image processing*, 1999.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Direct {
    /// Whether to align at all; `false` equals [`Unrefined`](super::Unrefined).
    pub refine: bool,
    /// Side of the window (px); odd, 3 to 201.
    pub window: usize,
    /// Weights of the window's pixels.
    pub weight: Weight,
    /// Deformation of the window.
    pub warp: Warp,
    /// Maximum shift of the right pixel by the alignment (px).
    pub reach: f64,
    /// Minimum zero-normalised cross-correlation of the aligned windows.
    pub min_correlation: f64,
    /// Maximum number of iterations.
    pub iterations: usize,
    /// Treatment of a pair whose alignment fails.
    pub unaligned: Unaligned,
}

impl Default for Direct {
    fn default() -> Self {
        Self {
            refine: true,
            window: 11,
            weight: Weight::Gaussian,
            warp: Warp::AsSeen,
            reach: 1.5,
            min_correlation: 0.8,
            iterations: 20,
            unaligned: Unaligned::Drop,
        }
    }
}

impl Component for Direct {
    const NAME: &'static str = "direct";
    const SUMMARY: &'static str =
        "inverse-compositional Gauss–Newton alignment on cubic splines, with the covariance of each match";
    const SOURCE: &'static str = "Baker and Matthews, Lucas–Kanade 20 years on, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        let Self { refine: _, window, weight: _, warp: _, reach, min_correlation, iterations, unaligned: _ } = *self;
        let odd = window % 2 == 1 && (3..=201).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 3 to 201")?;
        in_range(reach > 0.0 && reach <= 100.0, "reach", reach, "more than 0, at most 100 (px)")?;
        let correlated = (-1.0..=1.0).contains(&min_correlation);
        in_range(correlated, "min-correlation", min_correlation, "a number from -1 to 1")?;
        in_range((1..=1000).contains(&iterations), "iterations", iterations, "a number from 1 to 1000")
    }
}

impl Refinement for Direct {
    fn refine_into(
        &self,
        pairs: &[Pair],
        left: &Image,
        right: &Image,
        rig: &StereoRig,
        work: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    ) {
        pixels.clear();
        if !self.refine {
            return pixels.extend(pairs.iter().map(apart));
        }
        let threads = work.threads();
        let Memory { aligners, aligned } = work.get();
        aligned.clear();
        aligned.resize(pairs.len(), None);
        threads.pieces(aligned, PIECE, aligners, |index, piece, aligner| {
            for (aligned, pair) in piece.iter_mut().zip(&pairs[index * PIECE..]) {
                let at = StereoPixels { left: pair.left.at, right: pair.right.at };
                let found = self.align_pair(left, right, rig, &at, aligner);
                *aligned = found.map(|found| together(&pair.left, &found.place(), &found.shape));
            }
        });
        let stays = |pair| (self.unaligned == Unaligned::Keep).then(|| apart(pair));
        pixels.extend(aligned.iter().zip(pairs).filter_map(|(aligned, pair)| aligned.or_else(|| stays(pair))));
    }
}

impl Direct {
    fn align_pair(
        &self,
        left: &Image,
        right: &Image,
        rig: &StereoRig,
        pair: &StereoPixels,
        aligner: &mut Aligner,
    ) -> Option<Aligned> {
        let Local { shape, epipolar } = Local::new(rig, pair, self.window as f64 / 2.0);
        let expected = Expected { place: pair.left, start: pair.right, shape, along: epipolar };
        self.overlay(left, right, &expected, aligner)
    }
}

/// The number of matches in a piece of the work.
const PIECE: usize = 64;

#[derive(Debug, Default)]
struct Memory {
    aligners: Vec<Aligner>,
    aligned: Vec<Option<UncertainPixels>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
    use seafix_geometry::{Pinhole, Pixel, Transform};

    use crate::locate::UncertainPixel;

    /// Waves, shifted `shift` px to the right and half of that down, with the given contrast and brightness offset.
    fn waves(shift: f64, contrast: f64, light: f64) -> Image {
        let value = |i: usize| {
            let (x, y) = ((i % 60) as f64 - shift, (i / 60) as f64 - 0.5 * shift);
            light + contrast * (libm::sin(0.5 * x + 0.2 * y) + libm::cos(0.6 * y - 0.3 * x) + libm::sin(0.9 * x))
        };
        Image::new(60, 60, (0..3600).map(|i| value(i) as f32).collect()).unwrap()
    }

    /// A rig with f = 500 px and the cameras side by side, 0.25 m apart.
    fn rig() -> StereoRig {
        let camera = Pinhole::new([60, 60], [500.0; 2], [29.5; 2], &[]).unwrap();
        let step = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
        StereoRig::new(camera, camera, step).unwrap()
    }

    fn pairs([left, right]: &[Image; 2], at: Pixel, start: Pixel, refine: &Direct) -> UncertainPixels {
        let pair =
            Pair { left: UncertainPixel::independent(at, 0.15), right: UncertainPixel::independent(start, 0.15) };
        refine.refine(&[pair], left, right, &rig())[0]
    }

    fn aligned(right: &Image, at: Pixel, start: Pixel, refine: &Direct) -> StereoPixels {
        pairs(&[waves(0.0, 30.0, 120.0), right.clone()], at, start, refine).at
    }

    #[test]
    fn a_shift_is_found_under_other_light() {
        let right = waves(0.62, 20.0, 80.0);
        for warp in [Warp::Translation, Warp::Slanted, Warp::Affine] {
            let refine = Direct { warp, ..Direct::default() };
            let at = Pixel { u: 30.3, v: 28.8 };
            let pair = aligned(&right, at, Pixel { u: 30.0, v: 29.5 }, &refine);
            assert_eq!(pair.left, at);
            assert!(pair.right.distance(&Pixel { u: 30.92, v: 29.11 }) < 0.03, "{warp:?}: {pair:?}");
        }
    }

    #[test]
    fn the_right_place_has_an_error_with_the_left_one_and_a_little_more() {
        let moving = Direct { warp: Warp::Translation, ..Direct::default() };
        let images = [waves(0.0, 30.0, 120.0), waves(0.62, 20.0, 80.0)];
        let pair = pairs(&images, Pixel { u: 30.3, v: 28.8 }, Pixel { u: 30.0, v: 29.5 }, &moving);
        let block = |i, j| pair.covariance.fixed_view::<2, 2>(i, j).into_owned();
        let place = Matrix2::identity() * 0.15f64.powi(2);
        assert_eq!([block(0, 0), block(0, 2), block(2, 0)], [place; 3]);
        let own = block(2, 2) - place;
        assert!(own.cholesky().is_some() && own.trace().sqrt() < 0.03, "{own}");
    }

    #[test]
    fn errors_are_consistent_with_the_covariance() {
        let mut state = 7_u64;
        let mut random = || {
            // Twelve uniform numbers make a normal one.
            let sum: f64 = (0..12)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 40) as f64 / (1 << 24) as f64
                })
                .sum();
            sum - 6.0
        };
        let trials = 300;
        for warp in [Warp::Translation, Warp::Affine] {
            let refine = Direct { window: 15, warp, ..Direct::default() };
            let mut sum = 0.0;
            for trial in 0..trials {
                let shift = (trial as f64 * 0.618).fract();
                let noisy = |image: Image, random: &mut dyn FnMut() -> f64| {
                    let pixels = image.pixels().iter().map(|p| p + 3.0 * random() as f32).collect();
                    Image::new(60, 60, pixels).unwrap()
                };
                let images =
                    [noisy(waves(0.0, 20.0, 120.0), &mut random), noisy(waves(shift, 20.0, 120.0), &mut random)];
                let at = Pixel { u: 30.0 + random() / 4.0, v: 30.0 + random() / 4.0 };
                let truth = Vector2::new(at.u + shift, at.v + 0.5 * shift);
                let start = Pixel { u: truth.x + 0.2, v: truth.y - 0.2 };
                let pair = pairs(&images, at, start, &refine);
                let (left, cross) =
                    (pair.covariance.fixed_view::<2, 2>(0, 0), pair.covariance.fixed_view::<2, 2>(2, 0));
                assert_ne!(cross[(0, 0)], 0.0, "not aligned");
                let own =
                    pair.covariance.fixed_view::<2, 2>(2, 2) - cross * left.try_inverse().unwrap() * cross.transpose();
                let error = Vector2::new(pair.at.right.u, pair.at.right.v) - truth;
                sum += (error.transpose() * own.try_inverse().unwrap() * error).x;
            }
            // The mean of 300 values of χ² with two degrees of freedom has a standard deviation of 0.12.
            let mean = sum / f64::from(trials);
            assert!((1.7..2.3).contains(&mean), "{warp:?}: {mean}");
        }
    }

    #[test]
    fn where_it_cannot_align_the_places_stay_or_the_pair_is_left_out() {
        let at = Pixel { u: 30.0, v: 30.0 };
        let start = Pixel { u: 30.4, v: 30.1 };
        let right = waves(0.62, 20.0, 80.0);
        let off = Direct { refine: false, ..Direct::default() };
        assert_eq!(aligned(&right, at, start, &off).right, start);
        let flat = Image::new(60, 60, vec![90.0; 3600]).unwrap();
        let tiny = Image::new(1, 1, vec![90.0]).unwrap();
        let (border, far) = (Pixel { u: 2.0, v: 30.0 }, Pixel { u: 34.0, v: 30.0 });
        for (why, image, at, start) in [
            ("a flat image", &flat, at, start),
            ("an image that is too small", &tiny, at, start),
            ("a window beyond the border", &right, border, start),
            ("a start beyond reach", &right, at, far),
        ] {
            let keep = Direct { unaligned: Unaligned::Keep, ..Direct::default() };
            assert_eq!(aligned(image, at, start, &keep).right, start, "{why}");
            let pair =
                Pair { left: UncertainPixel::independent(at, 0.15), right: UncertainPixel::independent(start, 0.15) };
            let left = waves(0.0, 30.0, 120.0);
            assert_eq!(Direct::default().refine(&[pair], &left, image, &rig()), [], "{why}");
        }
    }
}
