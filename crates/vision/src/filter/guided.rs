//! The guided filter, which smooths and preserves edges.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    image_filter::Filter,
    mean::{Means, mean_into},
};
use crate::{image::Image, workspace::Workspace};

/// The guided filter with the image as its own guide.
///
/// Each window of 2r + 1 pixels is fitted by a I + b with a = var / (var + σ²) and b = (1 − a) mean: contrast far below
/// σ is reduced to the mean, and edges far above σ remain. A pixel uses the mean of a and b over all windows that
/// contain it. Results are clipped to the range of the input, 0 to 255.
///
/// Source: He, Sun and Tang, *Guided image filtering*, ECCV 2010; PAMI 2013.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Guided {
    /// Half the side of the windows (px).
    pub radius: usize,
    /// Standard deviation of contrast that counts as noise (grey levels); its square is the paper's ε.
    pub sigma: f64,
}

impl Default for Guided {
    fn default() -> Self {
        Self { radius: 4, sigma: 5.0 }
    }
}

impl Component for Guided {
    const NAME: &'static str = "guided";
    const SUMMARY: &'static str = "the guided filter: noise reduction that preserves edges";
    const SOURCE: &'static str = "He, Sun and Tang, Guided image filtering, PAMI 2013";

    fn check(&self) -> Result<(), String> {
        in_range((1..=1000).contains(&self.radius), "radius", self.radius, "a number from 1 to 1000 (px)")?;
        let sigma = self.sigma;
        in_range((0.01..=255.0).contains(&sigma), "sigma", sigma, "a number from 0.01 to 255 (grey levels)")
    }
}

#[derive(Debug, Default)]
struct Scratch {
    means: Means,
    slope: Vec<f32>,
    offset: Vec<f32>,
    mean: Vec<f32>,
    rows: Vec<()>,
}

impl Filter for Guided {
    fn apply(&self, image: &mut Image, work: &mut Workspace) {
        let threads = work.threads();
        let Scratch { means, slope, offset, mean, rows } = work.get();
        let (width, band) = (image.width(), 64 * image.width());
        image.pixels_mut().iter_mut().for_each(|value| *value = value.clamp(0.0, 255.0));
        mean_into(image.pixels(), width, self.radius, threads, means, mean);
        offset.clear();
        offset.extend(image.pixels().iter().map(|value| value * value));
        mean_into(offset, width, self.radius, threads, means, slope);
        let noise = (self.sigma * self.sigma) as f32;
        threads.pieces(slope, band, rows, |index, slope, ()| {
            for (slope, &mean) in slope.iter_mut().zip(&mean[index * band..]) {
                let variance = (*slope - mean * mean).max(0.0);
                *slope = variance / (variance + noise);
            }
        });
        threads.pieces(offset, band, rows, |index, offset, ()| {
            let first = index * band;
            for ((offset, &slope), &mean) in offset.iter_mut().zip(&slope[first..]).zip(&mean[first..]) {
                *offset = (1.0 - slope) * mean;
            }
        });
        mean_into(slope, width, self.radius, threads, means, mean);
        mean_into(offset, width, self.radius, threads, means, slope);
        let (slope, offset) = (mean, slope);
        threads.pieces(image.pixels_mut(), band, rows, |index, pixels, ()| {
            let first = index * band;
            for ((pixel, &slope), &offset) in pixels.iter_mut().zip(&slope[first..]).zip(&offset[first..]) {
                *pixel = (slope * *pixel + offset).clamp(0.0, 255.0);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_goes_and_the_edge_stays() {
        // A step of 100 with a noise of ± 3 in a pattern without large scale.
        let noise = |x: usize, y: usize| ((x * 73 + y * 151 + x * y * 7) % 7) as f32 - 3.0;
        let pixel = |i: usize| if i % 60 < 30 { 50.0 } else { 150.0 } + noise(i % 60, i / 60);
        let image = Image::new(60, 50, (0..3000).map(pixel).collect()).unwrap();
        let out = Guided::default().filtered(&image);
        let deviation = |image: &Image| {
            let flat = (10..40).flat_map(|y| &image.row(y)[8..20]);
            (flat.map(|value| (value - 50.0).powi(2)).sum::<f32>() / 360.0).sqrt()
        };
        assert!(deviation(&image) > 1.9 && deviation(&out) < 0.6, "{} {}", deviation(&image), deviation(&out));
        for y in 10..40 {
            assert!(out.row(y)[30] - out.row(y)[29] > 90.0, "{:?}", &out.row(y)[28..32]);
        }
    }
}
