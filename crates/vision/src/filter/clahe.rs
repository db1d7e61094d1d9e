//! Contrast-limited adaptive histogram equalisation.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::image_filter::Filter;
use crate::{
    image::Image,
    workspace::{Threads, Workspace},
};

/// Contrast-limited adaptive histogram equalisation (CLAHE).
///
/// The image is divided into tiles. Each tile has a histogram over 0 to 255 in which no bin keeps more than `clip`
/// times the uniform count; the excess is spread evenly over all bins. The tile's mapping is the cumulative histogram,
/// linear within a bin, so that grey levels finer than a bin remain distinct. A pixel is mapped by the four nearest
/// tiles, interpolated between their centres. Values outside 0 to 255 are clamped.
///
/// The slope of a mapping, and so the gain of contrast and noise, never exceeds `clip` + 1. A constant image stays
/// constant, in general with another value.
///
/// Source: Zuiderveld, *Contrast limited adaptive histogram equalization*, Graphics Gems IV, 1994.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Clahe {
    /// Number of tiles along the width and along the height.
    pub tiles: usize,
    /// Clip limit of a bin, as a multiple of the uniform count.
    pub clip: f64,
    /// Number of bins of a histogram.
    pub bins: usize,
}

impl Default for Clahe {
    fn default() -> Self {
        Self { tiles: 8, clip: 2.0, bins: 256 }
    }
}

impl Component for Clahe {
    const NAME: &'static str = "clahe";
    const SUMMARY: &'static str = "contrast-limited adaptive histogram equalisation";
    const SOURCE: &'static str = "Zuiderveld, Contrast limited adaptive histogram equalization, Graphics Gems IV, 1994";

    fn check(&self) -> Result<(), String> {
        in_range((1..=64).contains(&self.tiles), "tiles", self.tiles, "a number from 1 to 64")?;
        in_range((1.0..=1000.0).contains(&self.clip), "clip", self.clip, "a number from 1 to 1000")?;
        in_range((16..=4096).contains(&self.bins), "bins", self.bins, "a number from 16 to 4096")
    }
}

#[derive(Debug, Default)]
struct Scratch {
    /// The mapping of each tile at the edges of the bins, tile by tile.
    mappings: Vec<f32>,
    histograms: Vec<Vec<u32>>,
    /// The interpolated mappings of one row of pixels, for each band.
    lines: Vec<Vec<f32>>,
}

impl Filter for Clahe {
    fn apply(&self, image: &mut Image, work: &mut Workspace) {
        let threads = work.threads();
        let Scratch { mappings, histograms, lines } = work.get();
        self.map_tiles(image, threads, mappings, histograms);
        let (width, [columns, rows]) = (image.width(), self.grid(image));
        let height = image.height();
        let edges = self.bins + 1;
        let band = 32;
        threads.pieces(image.pixels_mut(), band * width, lines, |index, pixels, line| {
            line.resize(columns * edges, 0.0);
            for (row, pixels) in pixels.chunks_exact_mut(width).enumerate() {
                let (above, below, part) = between(index * band + row, height, rows);
                let tiles = |row: usize| &mappings[row * columns * edges..][..columns * edges];
                for ((value, &a), &b) in line.iter_mut().zip(tiles(above)).zip(tiles(below)) {
                    *value = a + part * (b - a);
                }
                for (x, pixel) in pixels.iter_mut().enumerate() {
                    let (left, right, part) = between(x, width, columns);
                    let (bin, rest) = self.bin(*pixel);
                    let value = |tile: usize| {
                        let at = &line[tile * edges + bin..][..2];
                        at[0] + rest * (at[1] - at[0])
                    };
                    let (a, b) = (value(left), value(right));
                    *pixel = (a + part * (b - a)).clamp(0.0, 255.0);
                }
            }
        });
    }
}

impl Clahe {
    /// The number of tiles along each axis, at most the number of pixels.
    fn grid(&self, image: &Image) -> [usize; 2] {
        [self.tiles.min(image.width()), self.tiles.min(image.height())]
    }

    /// The bin of a value, and its position within the bin (0 to 1).
    #[inline(always)]
    fn bin(&self, value: f32) -> (usize, f32) {
        let at = value.clamp(0.0, 255.0) * (self.bins as f32 / 255.0);
        let bin = (at as usize).min(self.bins - 1);
        (bin, at - bin as f32)
    }

    /// Computes the mapping of each tile at the edges of the bins.
    fn map_tiles(&self, image: &Image, threads: Threads, mappings: &mut Vec<f32>, histograms: &mut Vec<Vec<u32>>) {
        let [columns, rows] = self.grid(image);
        let edges = self.bins + 1;
        mappings.resize(columns * rows * edges, 0.0);
        threads.pieces(mappings, edges, histograms, |tile, mapping, histogram| {
            let span = |index: usize, count: usize, size: usize| index * size / count..(index + 1) * size / count;
            let across = span(tile % columns, columns, image.width());
            let down = span(tile / columns, rows, image.height());
            histogram.clear();
            histogram.resize(self.bins, 0);
            for y in down.clone() {
                image.row(y)[across.clone()].iter().for_each(|&value| histogram[self.bin(value).0] += 1);
            }
            let pixels = (across.len() * down.len()) as f64;
            let max = self.clip * pixels / self.bins as f64;
            let kept: f64 = histogram.iter().map(|&count| f64::from(count).min(max)).sum();
            let fraction = (pixels - kept) / self.bins as f64;
            let mut sum = 0.0;
            mapping[0] = 0.0;
            for (edge, &count) in mapping[1..].iter_mut().zip(&*histogram) {
                sum += f64::from(count).min(max) + fraction;
                *edge = (255.0 * sum / pixels) as f32;
            }
        });
    }
}

/// The two tiles whose centres enclose pixel `at` of `size`, and its position between them (0 to 1).
///
/// Beyond the outermost centre it is the outermost tile alone.
#[inline(always)]
fn between(at: usize, size: usize, tiles: usize) -> (usize, usize, f32) {
    let place = (at as f32 + 0.5) * (tiles as f32 / size as f32) - 0.5;
    let place = place.clamp(0.0, (tiles - 1) as f32);
    let first = place as usize;
    (first, (first + 1).min(tiles - 1), place - first as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_tile_without_a_limit_is_the_histogram_equalised() {
        // 40 equally frequent values from 100 to 139 are spread over 0 to 255.
        let image = Image::new(40, 30, (0..1200).map(|i| 100.5 + (i % 40) as f32).collect()).unwrap();
        let out = Clahe { tiles: 1, clip: 1000.0, bins: 255 }.filtered(&image);
        for (x, value) in out.row(7).iter().enumerate() {
            // A value in the middle of its bin has half of the bin's count below it.
            let expected = 255.0 * (x as f32 + 0.5) / 40.0;
            assert!((value - expected).abs() < 1e-3, "{x}: {value}, not {expected}");
        }
    }

    #[test]
    fn an_even_histogram_or_a_limit_of_one_changes_nothing() {
        let ramp = Image::new(256, 40, (0..256 * 40).map(|i| (i % 256) as f32).collect()).unwrap();
        let out = Clahe { tiles: 1, ..Clahe::default() }.filtered(&ramp);
        assert!(out.pixels().iter().zip(ramp.pixels()).all(|(a, b)| (a - b).abs() < 1e-3));
        let out = Clahe { tiles: 1, clip: 1.0, bins: 256 };
        let mut dark = ramp.clone();
        dark.pixels_mut().iter_mut().for_each(|value| *value *= 0.2);
        let gain = |image: &Image| image.row(3)[200] - image.row(3)[100];
        assert!(gain(&out.filtered(&dark)) < 2.0 * gain(&dark));
        assert!(gain(&Clahe { tiles: 1, clip: 8.0, bins: 256 }.filtered(&dark)) > 4.0 * gain(&dark));
    }

    #[test]
    fn levels_finer_than_a_bin_stay_apart() {
        // 12 bits, 16 bins.
        let image = Image::new(64, 64, (0..4096).map(|i| i as f32 * (255.0 / 4095.0)).collect()).unwrap();
        let out = Clahe { tiles: 1, clip: 2.0, bins: 16 }.filtered(&image);
        assert!(out.pixels().windows(2).all(|w| w[0] < w[1]));
    }
}
