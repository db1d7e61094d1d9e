//! Detectors of man-made corners by the fit of a corner model.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    corners::{Corners, SIGMAS},
    detector::Detector,
    select::{self, Budget, Selection},
    tensor::{Measure, Tensor, Window},
};
use crate::{
    image::Image,
    keypoint::Keypoint,
    locate::{CornerFit, FITTED, Shape, UncertainPixel, fit_into},
    workspace::Workspace,
};

/// The settings of a detector that fits a corner model to Harris' candidates.
///
/// Candidates are the maxima of [`Harris`](super::Harris)' response. A corner model is fitted to the pixels around
/// each; a good fit gives the corner and its position. The response is the inverse of the larger eigenvalue of the
/// position's covariance (px⁻²), so sharp edges of high contrast at a right angle come first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FittedCorners {
    /// Standard deviation of the window for candidates (px).
    pub sigma: f64,
    /// Minimum response of a candidate, relative to the strongest of the image.
    pub quality: f64,
    /// Maximum number of candidates, spread over the image.
    pub candidates: usize,
    /// The model fit and its acceptance.
    pub fit: CornerFit,
    /// Maximum number of corners.
    pub features: usize,
    /// Selection of corners beyond that number.
    pub selection: Selection,
    /// Number of cells along the longer side of the image, for a balanced selection.
    pub cells: usize,
}

impl Default for FittedCorners {
    fn default() -> Self {
        Self {
            sigma: 1.5,
            quality: 1e-4,
            candidates: 3000,
            fit: CornerFit::default(),
            features: 1000,
            selection: Selection::Balanced,
            cells: 8,
        }
    }
}

/// Harris' constant k.
const K: f32 = 0.04;
/// The radius of non-maximum suppression of candidates (px).
const RADIUS: usize = 3;
/// The distance (px) below which two corners are the same.
const SAME: f64 = 1.0;

#[derive(Debug, Default)]
struct Scratch {
    candidates: Vec<Keypoint>,
    places: Vec<Option<UncertainPixel>>,
    selection: select::Scratch,
}

impl FittedCorners {
    fn check(&self) -> Result<(), String> {
        let Self { sigma, quality, candidates, ref fit, features, selection: _, cells } = *self;
        in_range(SIGMAS.contains(&sigma), "sigma", sigma, "a number from 0.3 to 100 (px)")?;
        in_range((0.0..=1.0).contains(&quality), "quality", quality, "a number from 0 to 1")?;
        in_range(candidates > 0, "candidates", candidates, "at least 1")?;
        in_range(features > 0, "features", features, "at least 1")?;
        in_range(cells > 0, "cells", cells, "at least 1")?;
        fit.check().map_err(|message| format!("fit.{message}"))
    }

    fn find(&self, shape: Shape, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let Scratch { candidates, places, .. } = work.get::<Scratch>();
        let (mut candidates, mut places) = (std::mem::take(candidates), std::mem::take(places));
        let corners = Corners {
            tensor: Tensor { window: Window::Gaussian, sigma: self.sigma, measure: Measure::Harris { k: K } },
            quality: self.quality,
            radius: RADIUS,
            budget: Budget { features: self.candidates, selection: self.selection, cells: self.cells },
        };
        corners.find(image, work, &mut candidates);
        fit_into(&self.fit, &[shape], image, &candidates, work, &mut places);
        found.clear();
        found.extend(candidates.iter().zip(&places).filter_map(|(candidate, place)| {
            let UncertainPixel { at, covariance } = (*place)?;
            let (mean, half) = (0.5 * covariance.trace(), 0.5 * (covariance[(0, 0)] - covariance[(1, 1)]));
            let greatest = mean + libm::hypot(half, covariance[(0, 1)]);
            Some(Keypoint { at, response: (1.0 / greatest) as f32, ..*candidate })
        }));
        one_each(found);
        let scratch = work.get::<Scratch>();
        let budget = Budget { features: self.features, selection: self.selection, cells: self.cells };
        budget.keep(found, [image.width(), image.height()], &mut scratch.selection);
        (scratch.candidates, scratch.places) = (candidates, places);
    }
}

/// Merges candidates that converge to one corner and keeps the best fit.
fn one_each(found: &mut Vec<Keypoint>) {
    let order = |a: &Keypoint, b: &Keypoint| a.at.v.total_cmp(&b.at.v).then(a.at.u.total_cmp(&b.at.u));
    found.sort_unstable_by(order);
    let mut kept = 0;
    for i in 0..found.len() {
        let corner = found[i];
        let near = (0..kept).rev().take_while(|&k| corner.at.v - found[k].at.v < SAME);
        match near.into_iter().find(|&k| found[k].at.distance(&corner.at) < SAME) {
            Some(k) if corner.response > found[k].response => {
                // The order stays: the corner moves by less than SAME.
                found[k] = corner;
                found[..kept].sort_unstable_by(order);
            }
            Some(_) => {}
            None => {
                found[kept] = corner;
                kept += 1;
            }
        }
    }
    found.truncate(kept);
}

/// Defines a detector of one corner shape.
macro_rules! detector {
    ($(#[$doc:meta])* $name:ident, $kebab:literal, $shape:expr, $summary:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
        #[serde(transparent)]
        pub struct $name(pub FittedCorners);

        impl Component for $name {
            const NAME: &'static str = $kebab;
            const SUMMARY: &'static str = $summary;
            const SOURCE: &'static str = FITTED;

            fn check(&self) -> Result<(), String> {
                self.0.check()
            }
        }

        impl Detector for $name {
            fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
                self.0.find($shape, image, work, found);
            }
        }
    };
}

detector!(
    /// Corners of chequerboards: two crossing edges, fitted by [`XCorner`](crate::XCorner).
    XCorners,
    "x-corner",
    Shape::Crossing,
    "corners of chequerboards: Harris' candidates that fit two crossing edges"
);

detector!(
    /// Corners of boxes: two edges that end at their intersection, fitted by [`LCorner`](crate::LCorner).
    LCorners,
    "l-corner",
    Shape::Wedge,
    "corners of boxes: Harris' candidates that fit two edges with a common end"
);

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    /// A grid of blurred corners 24 px apart at subpixel positions: dark squares on bright ground, or a chequerboard.
    fn grid(board: bool) -> (Image, Vec<Pixel>) {
        let cover = |i: usize, edge: f64| 0.5 * libm::erfc((edge - i as f64) / (0.8 * std::f64::consts::SQRT_2));
        let edges: Vec<f64> = (0..7).map(|k| 20.0 + 24.3 * f64::from(k)).collect();
        // A wave from −1 to 1 with a change of sign at each edge.
        let wave = |i: usize| {
            edges
                .iter()
                .enumerate()
                .fold(-1.0, |sum, (k, &edge)| sum + if k % 2 == 0 { 2.0 } else { -2.0 } * cover(i, edge))
        };
        let value = |i: usize| {
            let (x, y) = (wave(i % 190), wave(i / 190));
            120.0 + 60.0 * if board { x * y } else { 0.25 * (x + 1.0) * (y + 1.0) }
        };
        let image = Image::new(190, 190, (0..190 * 190).map(|i| value(i) as f32).collect()).unwrap();
        let corners = edges.iter().flat_map(|&v| edges.iter().map(move |&u| Pixel { u, v })).collect();
        (image, corners)
    }

    #[test]
    fn each_kind_is_found_at_its_place_and_the_other_is_not() {
        for board in [false, true] {
            let (image, corners) = grid(board);
            let (x, l) = (XCorners::default().detect(&image), LCorners::default().detect(&image));
            let (own, other) = if board { (x, l) } else { (l, x) };
            assert_eq!((own.len(), other.len()), (corners.len(), 0), "{board}");
            for corner in corners {
                let nearest = own.iter().map(|found| found.at.distance(&corner)).fold(f64::INFINITY, f64::min);
                assert!(nearest < 2e-3, "{board}: {corner:?} is {nearest} px away");
            }
        }
    }

    #[test]
    fn of_one_corner_the_best_fit_stays() {
        let at = |u, v, response| Keypoint { at: Pixel { u, v }, response, scale: 1.0 };
        let mut found = vec![at(5.0, 5.0, 1.0), at(5.2, 4.9, 3.0), at(9.0, 5.0, 2.0), at(5.1, 5.3, 2.0)];
        one_each(&mut found);
        assert_eq!(found, [at(5.2, 4.9, 3.0), at(9.0, 5.0, 2.0)]);
    }
}
