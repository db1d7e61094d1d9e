//! SURF's detector: blobs by the determinant of the Hessian.

use std::ops::Range;

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    detector::Detector,
    hessian::{self, Octave, lobe},
    integral::Integral,
    select::{self, Budget, Selection},
};
use crate::{
    image::Image,
    keypoint::Keypoint,
    workspace::{Threads, Workspace},
};

/// SURF's detector: dark or bright blobs at maxima, over position and scale, of the Hessian's determinant.
///
/// Box filters of side L = 9, 15, 21, … px approximate the second derivatives Lxx, Lyy, Lxy of the image smoothed with
/// σ = 1.2 L/9. The response is Lxx Lyy − (w Lxy)² (grey levels², since each lobe of a filter counts by its mean), with
/// w such that a quadratic surface has the same response in every direction. Each octave repeats the filters on the
/// image with 2×2 pixels summed to one. A maximum among its 26 neighbours moves to the vertex of the quadratic through
/// them; [`Keypoint::scale`] is its σ, the s of SURF's descriptor.
///
/// Limit: nothing is detected within reach of the next larger filter of the octave from the border.
///
/// Source: Bay, Tuytelaars and Van Gool, *SURF: speeded up robust features*, ECCV 2006; Bay, Ess, Tuytelaars and Van
/// Gool, CVIU 2008.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FastHessian {
    /// Number of octaves, each of half the resolution.
    pub octaves: usize,
    /// Number of scales of an octave with key points.
    pub layers: usize,
    /// Minimum response (grey levels²).
    pub threshold: f64,
    /// Maximum number of key points.
    pub features: usize,
    /// Selection of key points beyond that number.
    pub selection: Selection,
    /// Number of cells along the longer side of the image, for a balanced selection.
    pub cells: usize,
}

impl Default for FastHessian {
    fn default() -> Self {
        Self { octaves: 4, layers: 3, threshold: 20.0, features: 1000, selection: Selection::Strongest, cells: 8 }
    }
}

impl Component for FastHessian {
    const NAME: &'static str = "surf";
    const SUMMARY: &'static str = "blobs of any size by the determinant of the Hessian over scale, by box filters";
    const SOURCE: &'static str = "Bay, Tuytelaars and Van Gool, SURF: speeded up robust features, ECCV 2006";

    fn check(&self) -> Result<(), String> {
        let Self { octaves, layers, threshold, features, selection: _, cells } = *self;
        in_range((1..=8).contains(&octaves), "octaves", octaves, "a number from 1 to 8")?;
        in_range((1..=10).contains(&layers), "layers", layers, "a number from 1 to 10")?;
        in_range((0.0..=1e9).contains(&threshold), "threshold", threshold, "a number from 0 to 1e9 (grey levels²)")?;
        in_range(features > 0, "features", features, "at least 1")?;
        in_range(cells > 0, "cells", cells, "at least 1")
    }
}

/// The working memory of the detector.
#[derive(Debug, Default)]
struct Scratch {
    octaves: Vec<Integral>,
    bands: Vec<Band>,
    selection: select::Scratch,
}

/// A band of an octave's rows, with its key points.
#[derive(Debug, Default)]
struct Band {
    octave: usize,
    rows: Range<usize>,
    scratch: hessian::Scratch,
    found: Vec<Keypoint>,
}

impl Detector for FastHessian {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let threads = work.threads();
        let Scratch { octaves, bands, selection } = work.get();
        let unit = self.fill_octaves(image, octaves);
        let count = plan(&octaves[..self.octaves], threads, bands);
        let bands = &mut bands[..count];
        threads.pieces(bands, 1, &mut Vec::<()>::new(), |_, bands, ()| {
            for Band { octave, rows, scratch, found } in bands {
                let octave = Octave {
                    integral: &octaves[*octave],
                    number: *octave,
                    unit,
                    layers: self.layers,
                    min: self.threshold as f32,
                };
                found.clear();
                octave.search(rows.clone(), scratch, found);
            }
        });
        found.clear();
        found.extend(bands.iter().flat_map(|band| &band.found));
        let budget = Budget { features: self.features, selection: self.selection, cells: self.cells };
        budget.keep(found, [image.width(), image.height()], selection);
    }
}

impl FastHessian {
    /// Computes the integral images of all octaves; returns their unit (grey levels).
    fn fill_octaves(&self, image: &Image, octaves: &mut Vec<Integral>) -> f32 {
        octaves.resize_with(self.octaves.max(octaves.len()), Integral::default);
        let pixel = (1_u64 << (2 * (self.octaves - 1))) as f64;
        let lobe = lobe(self.layers + 1) as f64;
        let unit = octaves[0].fill(image, pixel * lobe * (2.0 * lobe - 1.0));
        for i in 1..self.octaves {
            let (finer, coarser) = octaves.split_at_mut(i);
            coarser[0].fill_half(&finer[i - 1]);
        }
        unit
    }
}

/// Divides all octaves into bands; returns their number.
fn plan(octaves: &[Integral], threads: Threads, bands: &mut Vec<Band>) -> usize {
    let mut count = 0;
    for (octave, integral) in octaves.iter().enumerate() {
        let [_, height] = integral.size();
        let rows = threads.rows_a_band(height);
        for start in (0..height).step_by(rows) {
            if count == bands.len() {
                bands.push(Band::default());
            }
            bands[count].octave = octave;
            bands[count].rows = start..(start + rows).min(height);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blobs (x, y, standard deviation (px), contrast).
    fn blobs(width: usize, height: usize, blobs: &[[f64; 4]]) -> Image {
        let grey = |x: f64, y: f64| {
            let blob = |&[u, v, sigma, contrast]: &[f64; 4]| {
                contrast * libm::exp(-0.5 * ((x - u) * (x - u) + (y - v) * (y - v)) / (sigma * sigma))
            };
            120.0 + blobs.iter().map(blob).sum::<f64>()
        };
        let pixels = (0..width * height).map(|i| grey((i % width) as f64, (i / width) as f64) as f32);
        Image::new(width, height, pixels.collect()).unwrap()
    }

    const BLOBS: [[f64; 4]; 4] =
        [[40.3, 50.6, 2.5, 80.0], [120.8, 60.1, 4.0, -60.0], [70.4, 120.7, 6.5, 70.0], [160.2, 130.3, 9.0, -90.0]];

    #[test]
    fn blobs_are_found_where_they_are_and_as_large_as_they_are() {
        let found = FastHessian { features: BLOBS.len(), ..FastHessian::default() }.detect(&blobs(220, 200, &BLOBS));
        for [u, v, sigma, _] in BLOBS {
            let nearest = found.iter().min_by(|a, b| {
                let distance = |p: &Keypoint| (p.at.u - u).hypot(p.at.v - v);
                distance(a).total_cmp(&distance(b))
            });
            let point = nearest.unwrap();
            let away = (point.at.u - u).hypot(point.at.v - v);
            assert!(away < 0.03 * sigma, "{point:?}, not {u} {v}");
            // A Gaussian blob responds most strongly to lobes of 1.68 times its standard deviation.
            let scale = 1.2 / 9.0 * 3.0 * 1.682 * sigma;
            assert!((f64::from(point.scale) / scale - 1.0).abs() < 0.12, "{point:?}, not {scale}");
        }
        assert_eq!(found.len(), BLOBS.len());
    }

    #[test]
    fn light_changes_nothing_and_contrast_only_the_response() {
        let image = blobs(220, 200, &BLOBS);
        let full = Image::new(220, 200, image.pixels().iter().map(|p| p.round()).collect()).unwrap();
        let found = FastHessian::default().detect(&full);
        let lit = Image::new(220, 200, full.pixels().iter().map(|p| p + 40.0).collect()).unwrap();
        assert_eq!(FastHessian::default().detect(&lit), found);
        let twice = Image::new(220, 200, full.pixels().iter().map(|p| 2.0 * p).collect()).unwrap();
        let twice = FastHessian { threshold: 80.0, ..FastHessian::default() }.detect(&twice);
        assert_eq!(twice.len(), found.len());
        for (a, b) in found.iter().zip(&twice) {
            assert!(a.at.distance(&b.at) < 1e-4 && (b.response / a.response - 4.0).abs() < 1e-4);
        }
    }

    #[test]
    fn a_quarter_turn_of_the_image_turns_the_blobs() {
        let image = blobs(224, 192, &BLOBS);
        // A quarter turn moves (x, y) to (y, width − 1 − x).
        let turned = (0..224 * 192).map(|i| image.row(i % 192)[223 - i / 192]).collect();
        let after = FastHessian::default().detect(&Image::new(192, 224, turned).unwrap());
        let before = FastHessian::default().detect(&image);
        assert_eq!(before.len(), after.len());
        for (a, b) in before.iter().zip(&after) {
            assert!((b.at.u - a.at.v).hypot(b.at.v - (223.0 - a.at.u)) < 1e-3, "{a:?} {b:?}");
        }
    }

    #[test]
    fn the_result_is_the_same_for_any_threads_and_in_used_memory() {
        let image = blobs(220, 200, &BLOBS);
        let surf = FastHessian { threshold: 0.0, ..FastHessian::default() };
        let found = surf.detect(&image);
        let mut work = Workspace::new(Threads::Pool);
        let mut again = Vec::new();
        for image in [&blobs(31, 90, &BLOBS), &image, &image] {
            surf.detect_into(image, &mut work, &mut again);
        }
        assert_eq!(again, found);
    }

    #[test]
    fn images_without_structure_have_no_blob() {
        let all = FastHessian { threshold: 0.0, octaves: 8, layers: 10, ..FastHessian::default() };
        for (width, height) in [(1, 1), (2, 1), (1, 300), (300, 20), (120, 121)] {
            let flat = Image::new(width, height, vec![77.7; width * height]).unwrap();
            assert_eq!(all.detect(&flat), []);
            let extremes = (0..width * height).map(|i| if i % 7 < 3 { f32::MAX } else { f32::MIN }).collect();
            all.detect(&Image::new(width, height, extremes).unwrap());
        }
    }
}
