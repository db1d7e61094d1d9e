//! The SURF descriptor.

use multiversion::multiversion;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    cells::{Cells, Grid},
    descriptor::{Descriptor, Descriptors},
    halves::Halves,
    sector::Sectors,
};
use crate::{detect::Keypoint, image::Image, workspace::Workspace};

/// SURF's descriptor: sums of Haar wavelet responses around the key point, 64 or 128 numbers.
///
/// The square window of 20 s around the key point has 4×4 sub-regions. In each, at 5×5 points one s apart, a Haar
/// wavelet of 2 s gives dx and dy, weighted by a Gaussian of 3.3 s about the key point. The sub-region contributes the
/// sums of dx, dy, |dx| and |dy|; extended, each sum is split by the sign of the other derivative. The vector is scaled
/// to unit length, so it is invariant under brightness offset and contrast. It is zero in a flat region.
///
/// Wavelets, window and sub-regions are at the key point's subpixel position; border pixels continue beyond the border.
/// Upright windows are sums of pixels and their parts. Windows rotated to the orientation of the surroundings (the
/// sliding sector of Bay et al.) are sums of bilinear samples. Use upright windows for the two cameras of a rig, and
/// rotated ones between frames, since the vehicle may have turned.
///
/// Source: Bay, Tuytelaars and Van Gool, *SURF: speeded up robust features*, ECCV 2006; Bay, Ess, Tuytelaars and Van
/// Gool, CVIU 2008.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Surf {
    /// Step s between wavelets (px), whose window is 20 s wide; 0: the key point's own scale.
    pub scale: f64,
    /// Whether the window is upright, or rotated to the orientation of its surroundings.
    pub upright: bool,
    /// Whether the descriptor has 128 numbers instead of 64.
    pub extended: bool,
}

impl Default for Surf {
    fn default() -> Self {
        Self { scale: 1.5, upright: true, extended: false }
    }
}

impl Component for Surf {
    const NAME: &'static str = "surf";
    const SUMMARY: &'static str = "SURF: sums of Haar wavelets around the key point, upright or rotated, 64 or 128";
    const SOURCE: &'static str = "Bay, Tuytelaars and Van Gool, SURF: speeded up robust features, ECCV 2006";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

/// The number of sub-regions along a side.
const REGIONS: usize = 4;
/// The number of wavelets along the side of a sub-region.
const SAMPLES: usize = 5;
/// The number of wavelets along the side of the window.
const SIDE: usize = REGIONS * SAMPLES;
/// The number of cells along the side: a wavelet spans two by two, and neighbours overlap by one.
const CELLS: usize = SIDE + 1;
/// The length of a column of cells in memory.
const LANES: usize = 24;
/// The number of key points in a piece of the work.
const PIECE: usize = 64;

/// The working memory of the descriptor.
#[derive(Debug, Default)]
struct Scratch {
    halves: Halves,
    /// The buffer of each piece.
    pieces: Vec<Vec<f32>>,
}

impl Descriptor for Surf {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors) {
        // The Gaussian in steps of s is the same for all key points.
        let weights: [f32; SIDE] = std::array::from_fn(|i| {
            let step = i as f64 - 0.5 * (SIDE - 1) as f64;
            libm::exp(-0.5 * step * step / (3.3 * 3.3)) as f32
        });
        let sectors = (!self.upright).then(Sectors::default);
        let length = REGIONS * REGIONS * if self.extended { 8 } else { 4 };
        let rows = described.numbers_mut(keypoints.len(), length);
        let threads = work.threads();
        let Scratch { halves, pieces } = work.get();
        let step = |keypoint: &Keypoint| if self.scale > 0.0 { self.scale } else { f64::from(keypoint.scale) };
        if !self.upright {
            halves.fill(image, keypoints.iter().map(step).fold(0.0, f64::max));
        }
        threads.pieces(rows, PIECE * length, pieces, |index, rows, scratch| {
            for (row, keypoint) in rows.chunks_exact_mut(length).zip(&keypoints[index * PIECE..]) {
                let step = step(keypoint);
                let mut cells = [[0.0; LANES]; CELLS];
                if let Some(sectors) = &sectors {
                    let along = sectors.orientation(image, keypoint.at, step, scratch);
                    let (grid, pixels, width) = halves.at(image, keypoint.at, step);
                    grid.turned(pixels, width, along, scratch, &mut cells);
                } else {
                    Grid::new(keypoint.at, step).upright(image, scratch, &mut cells);
                }
                if self.extended {
                    haar_sums::<8>(&cells, &weights, row);
                } else {
                    haar_sums::<4>(&cells, &weights, row);
                }
                normalise(row);
            }
        });
    }
}

/// Computes the sums over each sub-region, row by row: 4 each, or 8 split by sign.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn haar_sums<const PARTS: usize>(cells: &Cells<CELLS, LANES>, weights: &[f32; SIDE], row: &mut [f32]) {
    for region in 0..REGIONS {
        let mut sums = [[0.0; SIDE]; PARTS];
        for x in region * SAMPLES..(region + 1) * SAMPLES {
            let (left, right) = (&cells[x], &cells[x + 1]);
            for y in 0..SIDE {
                let weight = weights[x] * weights[y];
                let dx = weight * ((right[y] - left[y]) + (right[y + 1] - left[y + 1]));
                let dy = weight * ((left[y + 1] - left[y]) + (right[y + 1] - right[y]));
                if PARTS == 4 {
                    for (sum, part) in sums.iter_mut().zip([dx, dy, dx.abs(), dy.abs()]) {
                        sum[y] += part;
                    }
                } else {
                    // Σ dx and Σ |dx| for dy ≥ 0, the same for dy < 0; then Σ dy by the sign of dx.
                    let (down, up) = if dy >= 0.0 { (dx, 0.0) } else { (0.0, dx) };
                    let (east, west) = if dx >= 0.0 { (dy, 0.0) } else { (0.0, dy) };
                    let parts = [down, down.abs(), up, up.abs(), east, east.abs(), west, west.abs()];
                    for (sum, part) in sums.iter_mut().zip(parts) {
                        sum[y] += part;
                    }
                }
            }
        }
        for (part, sums) in sums.iter().enumerate() {
            for (y, sums) in sums.chunks_exact(SAMPLES).enumerate() {
                let mut total = 0.0;
                for sum in sums {
                    total += sum;
                }
                row[(y * REGIONS + region) * PARTS + part] = total;
            }
        }
    }
}

/// Scales to unit length; all zero in a flat region or for an image that is not finite.
fn normalise(row: &mut [f32]) {
    let norm = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    let finite = norm > 0.0 && norm < f64::INFINITY;
    for x in row {
        *x = if finite { (f64::from(*x) / norm) as f32 } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    fn image(f: impl Fn(f64, f64) -> f64) -> Image {
        let pixels = (0..80 * 60).map(|i| f(f64::from(i % 80), f64::from(i / 80)) as f32).collect();
        Image::new(80, 60, pixels).unwrap()
    }

    fn waves(x: f64, y: f64) -> f64 {
        (100.0 + 40.0 * libm::sin(0.31 * x + 0.1 * y) + 30.0 * libm::cos(0.23 * y - 0.05 * x * x / 10.0)).round()
    }

    fn at(u: f64, v: f64) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.5 }
    }

    #[test]
    fn a_ramp_has_only_its_own_derivative() {
        let described = Surf { scale: 1.0, ..Surf::default() }.describe(&image(|x, _| x), &[at(40.0, 30.0)]);
        for region in described.numbers().unwrap().row(0).chunks_exact(4) {
            assert!(region[0] > 0.0 && region[0] == region[2], "{region:?}");
            assert!(region[1].abs() < 1e-6 && region[3] < 1e-6, "{region:?}");
        }
        // The middle regions weigh more than the outer ones, and left equals right.
        let region = |i: usize| described.numbers().unwrap().row(0)[4 * i];
        assert!(region(5) > region(4) && region(4) > region(0));
        assert!((region(4) - region(7)).abs() < 1e-6);
    }

    #[test]
    fn the_norm_is_one_or_nothing_changes() {
        let points = [at(40.0, 30.0), at(0.0, 0.0), at(79.0, 59.0), at(-3.0, 70.0), at(12.3, 45.6)];
        let described = Surf::default().describe(&image(waves), &points);
        assert_eq!(described.len(), points.len());
        for i in 0..points.len() {
            let norm = described.numbers().unwrap().row(i).iter().map(|x| x * x).sum::<f32>();
            assert!((norm - 1.0).abs() < 1e-5, "{i}: {norm}");
        }
        let flat = Surf::default().describe(&image(|_, _| 137.0), &points);
        assert!((0..points.len()).all(|i| flat.numbers().unwrap().row(i).iter().all(|x| *x == 0.0)));
    }

    #[test]
    fn scale_zero_is_the_key_point_s_own() {
        let own = Surf { scale: 0.0, ..Surf::default() }.describe(&image(waves), &[at(40.0, 30.0)]);
        assert_eq!(own, Surf { scale: 1.5, ..Surf::default() }.describe(&image(waves), &[at(40.0, 30.0)]));
    }

    #[test]
    fn no_key_point_no_descriptor() {
        let one = Image::new(1, 1, vec![3.0]).unwrap();
        assert!(Surf::default().describe(&one, &[]).is_empty());
        assert_eq!(Surf::default().describe(&one, &[at(0.0, 0.0)]).len(), 1);
    }
}
