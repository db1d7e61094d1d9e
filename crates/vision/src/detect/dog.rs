//! SIFT's detector: extrema of differences of Gaussians.

use std::cmp::Ordering;

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::Pixel;
use serde::{Deserialize, Serialize};

use super::{
    detector::Detector,
    extrema,
    select::{self, Budget, Selection},
};
use crate::{
    image::Image,
    keypoint::Keypoint,
    scale_space::{INTERVALS, LEVELS, Octave, ScaleSpace, Strip, octaves, sigma},
    workspace::Workspace,
};

/// SIFT's detector: blobs at extrema, over position and scale, of the difference of Gaussians.
///
/// D(x, y, σ) = (G_kσ − G_σ) ∗ I with k = 2^(1/3) is nearly σ² ∇²G ∗ I up to a factor. An extremum among its 26
/// neighbours moves to the vertex of the quadratic through them; the fit is repeated from the next sample if the vertex
/// is nearer to that. An extremum is accepted if |D| is at least `contrast` and the ratio of its principal curvatures
/// is below `edge`, since positions along an edge are ill determined. The response is |D| (grey levels), the scale is
/// the σ of the extremum.
///
/// Limit: nothing is detected within five pixels (of the octave) of the border.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Dog {
    /// Doubles the image first: four times the key points and the time, scales from 0.9 px instead of 1.8 px.
    pub double: bool,
    /// Minimum |D| (grey levels).
    pub contrast: f64,
    /// Maximum ratio of principal curvatures.
    pub edge: f64,
    /// Maximum number of key points.
    pub features: usize,
    /// Selection of key points beyond that number.
    pub selection: Selection,
    /// Number of cells along the longer side of the image, for a balanced selection.
    pub cells: usize,
}

impl Default for Dog {
    fn default() -> Self {
        Self { double: true, contrast: 2.0, edge: 10.0, features: 1000, selection: Selection::Balanced, cells: 8 }
    }
}

impl Component for Dog {
    const NAME: &'static str = "dog";
    const SUMMARY: &'static str = "blobs of any size: extrema of differences of Gaussians (SIFT's detector)";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        let Self { double: _, contrast, edge, features, selection: _, cells } = *self;
        // Rounding alone causes differences of 1e-4 grey levels.
        in_range((0.01..=255.0).contains(&contrast), "contrast", contrast, "a number from 0.01 to 255 (grey levels)")?;
        in_range((1.0..=1e6).contains(&edge), "edge", edge, "a number from 1 to 1e6")?;
        in_range(features > 0, "features", features, "at least 1")?;
        in_range(cells > 0, "cells", cells, "at least 1")
    }
}

#[derive(Debug, Default)]
struct Scratch {
    bands: Vec<Band>,
    pieces: Vec<()>,
    select: select::Scratch,
}

/// The working memory of a band of an octave's rows.
#[derive(Debug, Default)]
struct Band {
    rows: Vec<f32>,
    /// The samples (level, x, y).
    samples: Vec<[usize; 3]>,
    found: Vec<Keypoint>,
}

/// The number of an octave's rows that one thread searches at a time.
const ROWS: usize = 32;
/// The border without detections (px of the octave).
const BORDER: usize = 5;

impl Detector for Dog {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let threads = work.threads();
        found.clear();
        // Two buffers of the workspace are needed at once: each is taken out and put back.
        let mut space = std::mem::take(work.get::<ScaleSpace>());
        let Scratch { bands, pieces, select } = work.get();
        space.look_at(image);
        for octave in -i32::from(self.double)..octaves(image.width(), image.height()) {
            space.sweep(octave, LEVELS - 1, threads, |levels, Strip { rows, first }| {
                // Rows in the strip's numbering; the octave's own border applies if the strip ends there.
                let begin = (rows.start - first).max(BORDER);
                let end = (rows.end - first).min(levels.height().saturating_sub(BORDER));
                if begin >= end || levels.width() <= 2 * BORDER {
                    return;
                }
                let count = (end - begin).div_ceil(ROWS);
                bands.resize_with(count.max(bands.len()), Band::default);
                threads.pieces(&mut bands[..count], 1, pieces, |index, band, ()| {
                    let rows = begin + index * ROWS..(begin + (index + 1) * ROWS).min(end);
                    self.search(levels, octave, first, rows, &mut band[0]);
                });
                bands[..count].iter().for_each(|band| found.extend(&band.found));
            });
        }
        // Several samples may lead to one extremum, bit for bit.
        let place = |a: &Keypoint| [a.at.v, a.at.u, f64::from(a.scale)];
        found.sort_unstable_by(|a, b| {
            let parts = place(a).into_iter().zip(place(b));
            parts.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(&b)))
        });
        found.dedup();
        let budget = Budget { features: self.features, selection: self.selection, cells: self.cells };
        budget.keep(found, [image.width(), image.height()], select);
        *work.get() = space;
    }
}

impl Dog {
    /// The key points of these rows of an octave, whose levels begin with row `first`.
    fn search(&self, octave: &Octave, number: i32, first: usize, rows: std::ops::Range<usize>, band: &mut Band) {
        let Band { rows: scratch, samples, found } = band;
        samples.clear();
        found.clear();
        // The quadratic changes |D| little, so samples far below the threshold need no refinement.
        let min = 0.5 * self.contrast as f32;
        extrema::extrema(octave, rows, BORDER, min, scratch, samples);
        found.extend(samples.iter().filter_map(|&at| self.refine(octave, number, first, at)));
    }

    /// The extremum near a sample, by the quadratic through its neighbours.
    fn refine(
        &self,
        octave: &Octave,
        number: i32,
        first: usize,
        [mut level, mut x, mut y]: [usize; 3],
    ) -> Option<Keypoint> {
        let width = octave.width();
        for _ in 0..5 {
            let d = |dl: usize, dy: usize, dx: usize| {
                let at = (y + dy - 1) * width + x + dx - 1;
                f64::from(octave.level(level + dl)[at] - octave.level(level + dl - 1)[at])
            };
            let centre = d(1, 1, 1);
            let gradient =
                0.5 * Vector3::new(d(1, 1, 2) - d(1, 1, 0), d(1, 2, 1) - d(1, 0, 1), d(2, 1, 1) - d(0, 1, 1));
            let xx = d(1, 1, 2) + d(1, 1, 0) - 2.0 * centre;
            let yy = d(1, 2, 1) + d(1, 0, 1) - 2.0 * centre;
            let ss = d(2, 1, 1) + d(0, 1, 1) - 2.0 * centre;
            let xy = 0.25 * ((d(1, 2, 2) + d(1, 0, 0)) - (d(1, 0, 2) + d(1, 2, 0)));
            let xs = 0.25 * ((d(2, 1, 2) + d(0, 1, 0)) - (d(0, 1, 2) + d(2, 1, 0)));
            let ys = 0.25 * ((d(2, 2, 1) + d(0, 0, 1)) - (d(0, 2, 1) + d(2, 0, 1)));
            let hessian = Matrix3::new(xx, xy, xs, xy, yy, ys, xs, ys, ss);
            let step = -(hessian.try_inverse()? * gradient);
            if step.iter().all(|part| part.abs() < 0.5) {
                let response = (centre + 0.5 * gradient.dot(&step)).abs();
                let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
                let round = determinant > 0.0
                    && trace * trace * self.edge < (self.edge + 1.0) * (self.edge + 1.0) * determinant;
                let pixel = libm::exp2(f64::from(number));
                let place = |sample: usize, part: f64| (sample as f64 + part) * pixel;
                return (response >= self.contrast && round).then(|| Keypoint {
                    at: Pixel { u: place(x, step.x), v: place(first + y, step.y) },
                    response: response as f32,
                    scale: sigma(number, level as f64 + step.z) as f32,
                });
            }
            // The nearest sample; a long step comes from a quadratic that does not hold.
            let moved = |sample: usize, part: f64, low: usize, high: usize| {
                let to = sample as f64 + part.clamp(-2.0, 2.0).round();
                (part.is_finite() && (low as f64..=high as f64).contains(&to)).then_some(to as usize)
            };
            level = moved(level, step.z, 1, INTERVALS)?;
            x = moved(x, step.x, BORDER, width - BORDER - 1)?;
            y = moved(y, step.y, BORDER, octave.height() - BORDER - 1)?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::Threads;

    /// Gaussian blobs (x, y, σ, height) on grey.
    fn blobs(width: usize, height: usize, blobs: &[[f64; 4]]) -> Image {
        let value = |i: usize| {
            let blob = |[u, v, sigma, height]: &[f64; 4]| {
                let (x, y) = ((i % width) as f64 - u, (i / width) as f64 - v);
                height * libm::exp(-0.5 * (x * x + y * y) / (sigma * sigma))
            };
            (100.0 + blobs.iter().map(blob).sum::<f64>()) as f32
        };
        Image::new(width, height, (0..width * height).map(value).collect()).unwrap()
    }

    fn texture(width: usize, height: usize) -> Image {
        let hash = |x: usize, y: usize| {
            let h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
            ((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) as f32
        };
        let value = |x: usize, y: usize| 0.5 * (hash(x / 7, y / 7) + hash(x / 3, y / 3 + 999));
        Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect()).unwrap()
    }

    #[test]
    fn strips_change_no_key_point() {
        let image = texture(80, 600);
        let mut work = Workspace::new(Threads::One);
        *work.get() = ScaleSpace::keeping(3000);
        let (dog, mut found) = (Dog::default(), Vec::new());
        dog.detect_into(&image, &mut work, &mut found);
        let full = dog.detect(&image);
        assert!(full.len() > 100 && found == full, "{} and {}", found.len(), full.len());
    }

    #[test]
    fn a_blob_is_found_where_it_is_and_as_large_as_it_is() {
        // D of a blob of σ is largest at t = σ / √k, with k the ratio of the two Gaussians.
        for [u, v, sigma, height] in
            [[90.3, 61.8, 3.0, 80.0], [88.0, 60.5, 6.0, 120.0], [71.4, 66.6, 10.0, -60.0], [80.0, 60.0, 1.6, 90.0]]
        {
            let found = Dog::default().detect(&blobs(170, 130, &[[u, v, sigma, height]]));
            let best = found[0];
            assert!(best.at.distance(&Pixel { u, v }) < 0.02 * sigma, "{best:?} for {u}, {v}, {sigma}");
            let expected = sigma * libm::exp2(-1.0 / 6.0);
            assert!((f64::from(best.scale) / expected - 1.0).abs() < 0.03, "{best:?}, not {expected}");
            assert!(found.iter().skip(1).all(|other| other.response < 0.3 * best.response), "{found:?}");
        }
    }

    #[test]
    fn edges_and_flat_images_have_none() {
        let image = |f: &dyn Fn(usize, usize) -> f32| {
            Image::new(120, 90, (0..120 * 90).map(|i| f(i % 120, i / 120)).collect()).unwrap()
        };
        assert_eq!(Dog::default().detect(&image(&|_, _| 77.7)), []);
        assert_eq!(Dog::default().detect(&image(&|x, _| if x < 60 { 20.0 } else { 200.0 })), []);
        assert_eq!(Dog::default().detect(&image(&|x, y| (x + 2 * y) as f32 * 0.7)), []);
        for (width, height) in [(1, 1), (2, 2), (1, 300), (300, 1), (11, 11), (12, 40)] {
            Dog::default().detect(&texture(width, height));
        }
    }

    #[test]
    fn half_the_image_has_half_the_scale() {
        let large = blobs(400, 320, &[[120.0, 100.0, 8.0, 90.0], [280.0, 200.0, 12.0, -70.0]]);
        let small = blobs(200, 160, &[[60.0, 50.0, 4.0, 90.0], [140.0, 100.0, 6.0, -70.0]]);
        let (a, b) = (Dog::default().detect(&large), Dog::default().detect(&small));
        for (a, b) in a.iter().zip(&b).take(2) {
            assert!(a.at.distance(&Pixel { u: 2.0 * b.at.u, v: 2.0 * b.at.v }) < 0.05, "{a:?} {b:?}");
            assert!((a.scale / b.scale - 2.0).abs() < 0.05, "{a:?} {b:?}");
        }
    }

    #[test]
    fn threads_and_memory_change_nothing_and_the_budget_is_kept() {
        let dog = Dog { features: 150, ..Dog::default() };
        let images = [texture(200, 150), texture(90, 70), texture(210, 170)];
        let mut found = Vec::new();
        let mut works = [Workspace::new(Threads::One), Workspace::new(Threads::Pool)];
        for image in images.iter().chain(&images) {
            let expected = dog.detect(image);
            assert!(expected.len() > 40 && expected.len() <= 150, "{}", expected.len());
            assert!(expected.windows(2).all(|w| w[0].response >= w[1].response));
            for work in &mut works {
                dog.detect_into(image, work, &mut found);
                assert_eq!(found, expected);
            }
        }
        let all = Dog { features: usize::MAX, ..Dog::default() }.detect(&images[0]);
        let none_twice = |i: usize| all[..i].iter().all(|other| other != &all[i]);
        assert!((0..all.len()).all(none_twice));
        let coarse = Dog { double: false, ..Dog::default() }.detect(&images[0]);
        assert!(coarse.iter().all(|point| point.scale > 1.6));
    }

    #[test]
    fn more_light_everywhere_changes_nothing_to_speak_of() {
        let image = texture(160, 120);
        let brighter = Image::new(160, 120, image.pixels().iter().map(|p| p + 40.0).collect()).unwrap();
        let (a, b) = (Dog::default().detect(&image), Dog::default().detect(&brighter));
        let matched = a.iter().filter(|a| b.iter().any(|b| a.at.distance(&b.at) < 0.01)).count();
        assert!(matched + 2 >= a.len() && a.len() > 50, "{matched} of {}", a.len());
    }
}
