//! The normalised window as a descriptor.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    descriptor::{Descriptor, Descriptors},
    sample::bilinear,
};
use crate::{
    detect::Keypoint,
    gaussian::{half_kernel_into, smooth_into},
    image::Image,
    workspace::Workspace,
};

/// The window around the key point with zero mean and unit norm.
///
/// The scalar product of two such windows is their zero-normalised cross-correlation ρ, so their Euclidean distance is
/// √(2 (1 − ρ)). It is invariant under gain and offset of brightness, but not under rotation: use it for the two views
/// of one instant, not for a vehicle that has turned.
///
/// The window is square and upright, sampled at `window`² points `step` apart from the image under a Gaussian; the
/// nearest pixel is repeated beyond the border. All numbers are zero in a flat region, or if values overflow.
///
/// Source: Lewis, *Fast normalized cross-correlation*, Vision Interface, 1995.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ZnccPatch {
    /// Number of samples along a side; odd.
    pub window: usize,
    /// Spacing of the samples (px).
    pub step: f64,
    /// Standard deviation of the Gaussian (px); 0: no smoothing.
    pub sigma: f64,
}

impl Default for ZnccPatch {
    fn default() -> Self {
        Self { window: 11, step: 2.0, sigma: 1.2 }
    }
}

impl Component for ZnccPatch {
    const NAME: &'static str = "zncc-patch";
    const SUMMARY: &'static str = "the window itself, zero mean and unit norm: distances are correlations";
    const SOURCE: &'static str = "Lewis, Fast normalized cross-correlation, Vision Interface, 1995";

    fn check(&self) -> Result<(), String> {
        let Self { window, step, sigma } = *self;
        let odd = window % 2 == 1 && (3..=51).contains(&window);
        in_range(odd, "window", window, "an odd number from 3 to 51 (samples)")?;
        in_range((0.1..=100.0).contains(&step), "step", step, "a number from 0.1 to 100 (px)")?;
        in_range((0.0..=100.0).contains(&sigma), "sigma", sigma, "a number from 0 to 100 (px)")
    }
}

#[derive(Debug, Default)]
struct Scratch {
    kernel: Vec<f32>,
    rows: Vec<Vec<f32>>,
    smooth: Vec<f32>,
    pieces: Vec<()>,
}

/// The number of key points in a piece of the work.
const PIECE: usize = 32;

impl Descriptor for ZnccPatch {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors) {
        let threads = work.threads();
        let Scratch { kernel, rows, smooth, pieces } = work.get();
        let (width, length) = (image.width(), self.window * self.window);
        let pixels = if self.sigma > 0.0 && !keypoints.is_empty() {
            half_kernel_into(self.sigma, 3.0, kernel);
            smooth_into(image.pixels(), width, kernel, threads, rows, smooth);
            smooth
        } else {
            image.pixels()
        };
        let numbers = described.numbers_mut(keypoints.len(), length);
        threads.pieces(numbers, PIECE * length, pieces, |piece, numbers, ()| {
            let here = keypoints[piece * PIECE..].iter();
            for (patch, keypoint) in numbers.chunks_exact_mut(length).zip(here) {
                self.sample(pixels, width, keypoint, patch);
                normalise(patch);
            }
        });
    }
}

impl ZnccPatch {
    fn sample(&self, pixels: &[f32], width: usize, keypoint: &Keypoint, patch: &mut [f32]) {
        let first = -0.5 * (self.window - 1) as f64;
        for (j, row) in patch.chunks_exact_mut(self.window).enumerate() {
            let v = keypoint.at.v + self.step * (first + j as f64);
            for (i, value) in row.iter_mut().enumerate() {
                let u = keypoint.at.u + self.step * (first + i as f64);
                *value = bilinear(pixels, width, u as f32, v as f32);
            }
        }
    }
}

/// Scales to zero mean and unit norm; all zero in a flat region or if values overflow.
fn normalise(patch: &mut [f32]) {
    let mean = patch.iter().map(|&value| f64::from(value)).sum::<f64>() / patch.len() as f64;
    let squares = patch.iter().map(|&value| (f64::from(value) - mean) * (f64::from(value) - mean)).sum::<f64>();
    // Smoothing leaves rounding errors of 1e-5 grey levels in flat regions; brightness near the largest finite number
    // overflows.
    if squares > 1e-6 * patch.len() as f64 && squares.is_finite() {
        let scale = 1.0 / squares.sqrt();
        patch.iter_mut().for_each(|value| *value = ((f64::from(*value) - mean) * scale) as f32);
    } else {
        patch.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::Threads;
    use seafix_geometry::Pixel;

    fn image(f: impl Fn(f64, f64) -> f64) -> Image {
        let pixels = (0..80 * 60).map(|i| f(f64::from(i % 80), f64::from(i / 80)) as f32).collect();
        Image::new(80, 60, pixels).unwrap()
    }

    fn waves(x: f64, y: f64) -> f64 {
        100.0 + 40.0 * libm::sin(0.31 * x + 0.1 * y) + 30.0 * libm::cos(0.23 * y - 0.05 * x * x / 10.0)
    }

    fn at(u: f64, v: f64) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.5 }
    }

    #[test]
    fn three_by_three_by_hand() {
        // x + 3 y at nine pixels: −4 … 4 about the mean, Σ = 60.
        let plane = image(|x, y| x + 3.0 * y);
        let patch = ZnccPatch { window: 3, step: 1.0, sigma: 0.0 }.describe(&plane, &[at(10.0, 20.0)]);
        let found = patch.numbers().unwrap().row(0);
        for (i, value) in found.iter().enumerate() {
            assert!((f64::from(*value) - (i as f64 - 4.0) / 60.0_f64.sqrt()).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn light_and_contrast_drop_out_and_the_distance_is_the_correlation() {
        let points = [at(40.2, 30.7), at(3.0, 2.0), at(-500.0, 900.0)];
        let a = ZnccPatch::default().describe(&image(waves), &points);
        let b = ZnccPatch::default().describe(&image(|x, y| 0.5 * waves(x, y) + 64.0), &points);
        let c = ZnccPatch::default().describe(&image(|x, y| waves(x + 3.0, y)), &points);
        let [a, b, c] = [&a, &b, &c].map(|d| d.numbers().unwrap());
        assert!(a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 1e-5));
        let product: f32 = a.row(0).iter().zip(c.row(0)).map(|(a, c)| a * c).sum();
        let distance: f32 = a.row(0).iter().zip(c.row(0)).map(|(a, c)| (a - c) * (a - c)).sum();
        assert!((distance - 2.0 * (1.0 - product)).abs() < 1e-5 && product < 0.9);
        assert!(a.row(2).iter().all(|value| *value == 0.0), "a window far outside is not flat");
    }

    #[test]
    fn threads_and_memory_change_nothing() {
        let points: Vec<Keypoint> = (0..99).map(|i| at(f64::from(i) * 0.8, f64::from(i * 7 % 60))).collect();
        let expected = ZnccPatch::default().describe(&image(waves), &points);
        let mut described = Descriptors::default();
        let mut work = Workspace::new(Threads::Pool);
        for image in [image(|x, _| x), image(waves)] {
            ZnccPatch::default().describe_into(&image, &points, &mut work, &mut described);
        }
        assert_eq!(described, expected);
        assert!(ZnccPatch::default().describe(&image(waves), &[]).is_empty());
    }
}
