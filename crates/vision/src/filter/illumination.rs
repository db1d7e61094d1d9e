//! Correction of uneven illumination.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    image_filter::Filter,
    mean::{Means, mean_into},
};
use crate::{image::Image, workspace::Workspace};

/// Shading correction: division by the lamps' light or subtraction of backscatter, estimated as the smooth background.
///
/// The background B is the image after three means over windows of 2r + 1 pixels, nearly a Gaussian of standard
/// deviation σ (r = ½ (√(4σ² + 1) − 1)). Lamps multiply, so `divide` gives I · min(m / B, gain) with the image's mean
/// m. Backscatter adds, so `subtract` gives I − B + m. Results are clipped to 0 to 255.
///
/// Source: Gonzalez and Woods, *Digital image processing*, 2002, shading correction; the windows: Wells, *Efficient
/// synthesis of Gaussian filters by cascaded uniform filters*, PAMI 1986.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Illumination {
    /// Standard deviation of the smoothing (px): larger than the structure of interest, smaller than a lamp's cone.
    pub sigma: f64,
    /// Operation with the background.
    pub operation: Operation,
    /// Maximum gain of a dark pixel, for `divide`.
    pub gain: f64,
}

/// Operation with the background.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Operation {
    /// Division of the image by the background.
    Divide,
    /// Subtraction of the background from the image.
    Subtract,
}

impl Default for Illumination {
    fn default() -> Self {
        Self { sigma: 40.0, operation: Operation::Divide, gain: 4.0 }
    }
}

impl Component for Illumination {
    const NAME: &'static str = "illumination";
    const SUMMARY: &'static str = "shading correction: division by the lamps' light or subtraction of backscatter";
    const SOURCE: &'static str = "Gonzalez and Woods, Digital image processing, 2002";

    fn check(&self) -> Result<(), String> {
        in_range((1.0..=1000.0).contains(&self.sigma), "sigma", self.sigma, "a number from 1 to 1000 (px)")?;
        in_range((1.0..=1000.0).contains(&self.gain), "gain", self.gain, "a number from 1 to 1000")
    }
}

/// The number of successive means; more are nearer to a Gaussian.
const PASSES: usize = 3;

#[derive(Debug, Default)]
struct Scratch {
    means: Means,
    background: Vec<f32>,
    other: Vec<f32>,
    rows: Vec<()>,
}

impl Filter for Illumination {
    fn apply(&self, image: &mut Image, work: &mut Workspace) {
        let threads = work.threads();
        let Scratch { means, background, other, rows } = work.get();
        let width = image.width();
        // A window of n pixels has the variance (n² − 1) / 12.
        let radius = libm::round(0.5 * (libm::sqrt(12.0 * self.sigma * self.sigma / PASSES as f64 + 1.0) - 1.0));
        let radius = radius as usize;
        mean_into(image.pixels(), width, radius, threads, means, background);
        for _ in 1..PASSES {
            mean_into(background, width, radius, threads, means, other);
            std::mem::swap(background, other);
        }
        let sum: f64 = image.pixels().iter().map(|&value| f64::from(value)).sum();
        let mean = (sum / image.pixels().len() as f64) as f32;
        let (operation, gain) = (self.operation, self.gain as f32);
        let band = 64 * width;
        threads.pieces(image.pixels_mut(), band, rows, |index, pixels, ()| {
            let pairs = pixels.iter_mut().zip(&background[index * band..]);
            match operation {
                Operation::Divide => pairs.for_each(|(pixel, &light)| {
                    let factor = if mean < gain * light { (mean / light).max(0.0) } else { gain };
                    *pixel = (*pixel * factor).clamp(0.0, 255.0);
                }),
                Operation::Subtract => pairs.for_each(|(pixel, &veil)| {
                    *pixel = (*pixel - veil + mean).clamp(0.0, 255.0);
                }),
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: impl Fn(f32, f32) -> f32) -> Image {
        Image::new(240, 180, (0..240 * 180).map(|i| value((i % 240) as f32, (i / 240) as f32)).collect()).unwrap()
    }

    /// The smallest and the largest mean of windows of 8×8 px away from the border.
    fn spread(image: &Image) -> (f32, f32) {
        let mean = |x: usize, y: usize| (0..64).map(|i| image.row(y + i / 8)[x + i % 8]).sum::<f32>() / 64.0;
        let means =
            (40..136).step_by(8).flat_map(|y| (40..192).step_by(8).map(move |x| (x, y))).map(|(x, y)| mean(x, y));
        means.fold((f32::INFINITY, 0.0), |(min, max), mean| (min.min(mean), max.max(mean)))
    }

    #[test]
    fn light_that_falls_off_is_evened() {
        let checks = |x: f32, y: f32| if ((x / 4.0) as i32 + (y / 4.0) as i32) % 2 == 0 { 90.0 } else { 60.0 };
        let lamp = |x: f32, y: f32| 1.2 - ((x - 120.0).powi(2) + (y - 90.0).powi(2)) / 20000.0;
        let filter = Illumination { sigma: 10.0, ..Illumination::default() };
        let before = image(|x, y| checks(x, y) * lamp(x, y));
        let (min, max) = spread(&before);
        assert!(max / min > 1.4);
        let (min, max) = spread(&filter.filtered(&before));
        assert!(max / min < 1.03, "{min} to {max}");
        let filter = Illumination { operation: Operation::Subtract, ..filter };
        let (min, max) = spread(&filter.filtered(&image(|x, y| checks(x, y) + 60.0 * lamp(x, y))));
        assert!(max - min < 1.5, "{min} to {max}");
    }

    #[test]
    fn the_dark_is_brightened_by_no_more_than_the_gain() {
        let filter = Illumination { sigma: 5.0, gain: 3.0, ..Illumination::default() };
        let out = filter.filtered(&image(|x, _| if x < 120.0 { 1.0 } else { 200.0 }));
        assert_eq!(out.row(90)[5], 3.0);
        let dark = filter.filtered(&image(|_, _| 0.0));
        assert!(dark.pixels().iter().all(|&value| value == 0.0));
    }
}
