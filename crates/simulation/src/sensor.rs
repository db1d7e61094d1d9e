//! A simple camera model: blur, noise and 8-bit quantisation.

use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use crate::stream::Stream;

/// Lens and sensor of the virtual scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sensor {
    /// Standard deviation of the lens blur (px), from 0 to 20.
    pub blur: f64,
    /// Standard deviation of the pixel noise (grey levels), from 0 to 255.
    pub noise: f64,
    /// Brightness of a white surface that faces the light (grey levels), from 0 to 1 000 000.
    pub white: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { blur: 0.7, noise: 1.0, white: 255.0 }
    }
}

impl Sensor {
    /// Converts radiance (1: white facing the light) to an 8-bit image with noise.
    pub(crate) fn expose(&self, radiance: Vec<f32>, width: usize, mut noise: Stream) -> Vec<f32> {
        let mut image = blurred(radiance, width, self.blur);
        let mut normal = [0.0; CHUNK];
        for values in image.chunks_mut(CHUNK) {
            if self.noise > 0.0 {
                noise.normals(&mut normal[..values.len()]);
            }
            graded(values, self.white, self.noise, &normal);
        }
        image
    }
}

/// Number of pixels quantised in one pass.
const CHUNK: usize = 1024;

/// Rounds radiances to whole grey levels after adding noise of deviation `sigma` from normal numbers.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn graded(values: &mut [f32], white: f64, sigma: f64, normal: &[f64; CHUNK]) {
    for (value, normal) in values.iter_mut().zip(normal) {
        let grey = f64::from(*value) * white;
        let noisy = if sigma > 0.0 { grey + sigma * normal } else { grey };
        *value = noisy.round().clamp(0.0, 255.0) as f32;
    }
}

/// The image convolved with a Gaussian; border pixels are replicated.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn blurred(image: Vec<f32>, width: usize, sigma: f64) -> Vec<f32> {
    if !(sigma > 0.0) {
        return image;
    }
    let radius = (4.0 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=2 * radius)
        .map(|k| {
            let x = (k as f64 - radius as f64) / sigma;
            libm::exp(-0.5 * x * x)
        })
        .collect();
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| (w / sum) as f32).collect();
    let height = image.len() / width;

    let mut across = vec![0.0; image.len()];
    let mut padded = vec![0.0; width + 2 * radius];
    for (row, out) in image.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        for (k, w) in weights.iter().enumerate() {
            for (o, p) in out.iter_mut().zip(&padded[k..]) {
                *o += w * p;
            }
        }
    }
    let mut down = image;
    down.fill(0.0);
    for (y, out) in down.chunks_exact_mut(width).enumerate() {
        for (k, w) in weights.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1);
            for (o, p) in out.iter_mut().zip(&across[from * width..(from + 1) * width]) {
                *o += w * p;
            }
        }
    }
    down
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::Purpose;

    #[test]
    fn blur_keeps_the_sum_and_the_centre() {
        let (width, height) = (31, 21);
        let mut image = vec![0.0; width * height];
        image[10 * width + 15] = 100.0;
        let image = blurred(image, width, 0.7);
        let sum: f32 = image.iter().sum();
        assert!((sum - 100.0).abs() < 1e-3);
        let moment: f32 = image.iter().enumerate().map(|(k, v)| v * (k % width) as f32).sum::<f32>() / sum;
        assert!((moment - 15.0).abs() < 1e-5);
    }

    #[test]
    fn noise_has_the_stated_deviation_and_integer_levels() {
        let sensor = Sensor { noise: 2.0, ..Sensor::default() };
        let grey = sensor.expose(vec![0.5; 40_000], 200, Stream::new(1, 0, 0, Purpose::LeftImage));
        let mean = grey.iter().sum::<f32>() / 40_000.0;
        let variance = grey.iter().map(|g| (g - mean).powi(2)).sum::<f32>() / 40_000.0;
        assert!((mean - 127.5).abs() < 0.05);
        assert!((variance - 4.0 - 1.0 / 12.0).abs() < 0.15, "{variance}");
        assert!(grey.iter().all(|g| g.fract() == 0.0));
    }

    #[test]
    fn without_noise_the_sensor_only_rounds() {
        let sensor = Sensor { noise: 0.0, blur: 0.0, ..Sensor::default() };
        let grey = sensor.expose(vec![0.1, 2.0, -1.0], 3, Stream::new(1, 0, 0, Purpose::LeftImage));
        assert_eq!(grey, [26.0, 255.0, 0.0]);
    }
}
