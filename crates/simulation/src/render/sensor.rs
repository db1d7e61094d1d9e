//! The image sensor: exposure, gain, noise and quantisation.

use seafix_component::{Settings, in_range};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use super::math::mix;

/// Fraction of the full well that a radiance of 1 fills in a millisecond. One lamp of power 1 gives a white plate at 1
/// m the radiance 1/π.
const SENSITIVITY: f64 = 5.5;
/// Maximum gain.
const MAX_GAIN: f64 = 16.0;
/// Fraction of the pixels that automatic exposure leaves brighter than its target.
const BRIGHTEST: f64 = 0.02;

/// The image sensor after EMVA 1288.
///
/// The mean is μ = K·n + black and the variance σ² = K²(σ_read² + n) + quantisation, with n electrons and the gain K in
/// grey levels per electron. The defaults are those of a usual industrial CMOS sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Imager {
    /// Exposure time (ms), from 0.001 to 1000; the maximum with automatic exposure.
    pub exposure_ms: f64,
    /// Gain, from 0.01 to 16; the minimum with automatic exposure.
    pub gain: f64,
    /// Whether exposure time and gain follow the brightness of each pair.
    pub automatic: bool,
    /// Target brightness of automatic exposure as a fraction of white, from 0.01 to 1; 2 % of the pixels exceed it.
    pub target: f64,
    /// Full well capacity (electrons), from 100 to 1 000 000.
    pub full_well: f64,
    /// Standard deviation of the read noise (electrons), from 0 to 10 000.
    pub read_noise: f64,
    /// Whether the image has shot noise.
    pub shot_noise: bool,
    /// Photo response non-uniformity: relative standard deviation of the pixels' sensitivity, from 0 to 0.5.
    pub prnu: f64,
    /// Dark signal non-uniformity: standard deviation (electrons), from 0 to 10 000.
    pub dsnu: f64,
    /// Black level (grey levels), from 0 to 100.
    pub black: f64,
    /// Bits of a pixel: 8 or 12.
    pub bits: u8,
    /// Standard deviation of the lens blur (px), from 0 to 20.
    pub blur: f64,
    /// Readout time of a rolling shutter over all rows (ms), from 0 to 1000; 0 is a global shutter.
    pub readout_ms: f64,
    /// Delay of the right image after the left (ms), from −1000 to 1000; 0 is perfect synchronisation.
    pub sync_ms: f64,
}

impl Default for Imager {
    fn default() -> Self {
        Self {
            exposure_ms: 4.0,
            gain: 1.0,
            automatic: true,
            target: 0.8,
            full_well: 10_500.0,
            read_noise: 2.4,
            shot_noise: true,
            prnu: 0.007,
            dsnu: 0.5,
            black: 2.0,
            bits: 8,
            blur: 0.55,
            readout_ms: 0.0,
            sync_ms: 0.0,
        }
    }
}

impl Imager {
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("imager.{name}"), x, &format!("a number from {low} to {high}"))
        };
        within("exposure-ms", self.exposure_ms, 1e-3, 1e3)?;
        within("gain", self.gain, 0.01, MAX_GAIN)?;
        within("target", self.target, 0.01, 1.0)?;
        within("full-well", self.full_well, 100.0, 1e6)?;
        within("read-noise", self.read_noise, 0.0, 1e4)?;
        within("prnu", self.prnu, 0.0, 0.5)?;
        within("dsnu", self.dsnu, 0.0, 1e4)?;
        within("black", self.black, 0.0, 100.0)?;
        within("blur", self.blur, 0.0, 20.0)?;
        within("readout-ms", self.readout_ms, 0.0, 1e3)?;
        within("sync-ms", self.sync_ms, -1e3, 1e3)?;
        in_range(matches!(self.bits, 8 | 12), "imager.bits", self.bits, "8 or 12")
    }

    /// Exposure time (ms) and gain for the radiances of a pair.
    pub(super) fn exposed(&self, images: [&[f32]; 2]) -> Exposure {
        let fixed = Exposure { ms: self.exposure_ms, gain: self.gain };
        if !self.automatic {
            return fixed;
        }
        let mut some: Vec<f32> = images.iter().flat_map(|image| image.iter().step_by(37).copied()).collect();
        let rank = ((1.0 - BRIGHTEST) * (some.len() - 1) as f64) as usize;
        let (_, bright, _) = some.select_nth_unstable_by(rank, f32::total_cmp);
        let bright = f64::from(*bright) * SENSITIVITY * self.exposure_ms * self.gain;
        let factor = if bright > 0.0 { self.target / bright } else { f64::INFINITY };
        if factor < 1.0 {
            Exposure { ms: fixed.ms * factor, ..fixed }
        } else {
            Exposure { gain: (fixed.gain * factor).min(MAX_GAIN), ..fixed }
        }
    }

    /// The fixed pattern of one camera for a complete dive.
    pub(crate) fn pattern(&self, size: [u32; 2], seed: u32) -> Pattern {
        let normal = Normal::new();
        let pixels = size[0] * size[1];
        let list = |sigma: f64, salt: u32, centre: f32| {
            let draw = |k: u32| centre + sigma as f32 * normal.at(mix(k, salt, seed));
            if sigma > 0.0 { (0..pixels).map(draw).collect() } else { Vec::new() }
        };
        Pattern { response: list(self.prnu, 1, 1.0), dark: list(self.dsnu, 2, 0.0), normal }
    }

    /// Converts radiances to grey levels from 0 to 255, quantised to the bits.
    pub(super) fn develop(
        &self,
        image: &mut [f32],
        exposure: Exposure,
        pattern: &Pattern,
        seed: u32,
        threads: Threads,
    ) {
        const PIECE: usize = 1 << 16;
        let electrons = (SENSITIVITY * exposure.ms * self.full_well) as f32;
        let levels = f32::from((1_u16 << self.bits) - 1);
        // Grey levels per electron.
        let k = (f64::from(levels) * exposure.gain / self.full_well) as f32;
        let black = self.black as f32 * levels / 255.0;
        let (read2, back) = ((self.read_noise * self.read_noise) as f32, 255.0 / levels);
        let well = self.full_well as f32;
        let numbers = Numbers {
            electrons,
            well,
            read2,
            shot: if self.shot_noise { 1.0 } else { 0.0 },
            k,
            black,
            levels,
            back,
            seed,
        };
        threads.pieces(image, PIECE, &mut Vec::<()>::new(), |piece, pixels, ()| {
            numbers.develop(pixels, piece * PIECE, pattern);
        });
    }
}

/// Parameters of the conversion from radiance to grey levels, in single precision.
#[derive(Debug, Clone, Copy)]
struct Numbers {
    /// Electrons per unit of radiance.
    electrons: f32,
    /// Full well capacity (electrons).
    well: f32,
    /// Variance of the read noise (electrons²).
    read2: f32,
    /// Variance of each electron: 1 with shot noise, 0 without.
    shot: f32,
    /// Grey levels per electron.
    k: f32,
    /// Black level, in levels of the bits.
    black: f32,
    /// Level of white.
    levels: f32,
    /// Factor from levels of the bits to grey levels of 255.
    back: f32,
    seed: u32,
}

impl Numbers {
    /// Develops pixels whose index in the image starts at `first`.
    fn develop(&self, pixels: &mut [f32], first: usize, pattern: &Pattern) {
        developed(self, pixels, first, pattern);
    }
}

/// Number of pixels developed in one pass.
const CHUNK: usize = 64;

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn developed(numbers: &Numbers, pixels: &mut [f32], first: usize, pattern: &Pattern) {
    for (c, pixels) in pixels.chunks_mut(CHUNK).enumerate() {
        let (n, place) = (pixels.len(), first + c * CHUNK);
        let (mut values, mut response, mut dark) = ([0.0_f32; CHUNK], [1.0_f32; CHUNK], [0.0_f32; CHUNK]);
        values[..n].copy_from_slice(pixels);
        for (chunk, list) in [(&mut response, &pattern.response), (&mut dark, &pattern.dark)] {
            if let Some(list) = list.get(place..place + n) {
                chunk[..n].copy_from_slice(list);
            }
        }
        let mut bits = [0_u32; CHUNK];
        for (bits, i) in bits.iter_mut().zip(0..) {
            *bits = mix(place as u32 + i, 9, numbers.seed);
        }
        let mut cells = [[0.0_f32; 2]; CHUNK];
        for (cell, bits) in cells.iter_mut().zip(&bits) {
            *cell = pattern.normal.0[(bits >> 20) as usize];
        }
        for i in 0..CHUNK {
            let light = (values[i] * numbers.electrons * response[i]).clamp(0.0, numbers.well);
            let sigma = (numbers.read2 + numbers.shot * light).sqrt();
            let n = light + sigma * Normal::between(cells[i], bits[i]) + dark[i];
            let grey = numbers.k * n + numbers.black;
            values[i] = ((grey + 0.5).clamp(0.0, numbers.levels) as i32) as f32 * numbers.back;
        }
        pixels.copy_from_slice(&values[..n]);
    }
}

/// Exposure time and gain of one pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Exposure time (ms).
    pub ms: f64,
    /// Gain.
    pub gain: f64,
}

/// The fixed pattern of one camera: sensitivity and dark signal (electrons) of each pixel.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    response: Vec<f32>,
    dark: Vec<f32>,
    normal: Normal,
}

/// Normal numbers from random bits by a linearly interpolated quantile table, limited to ±4.1.
#[derive(Debug, Clone)]
pub(super) struct Normal(Vec<[f32; 2]>);

impl Normal {
    const CELLS: usize = 4096;

    fn new() -> Self {
        let n = Self::CELLS;
        let mut table: Vec<f64> = (0..=n).map(|k| quantile((k as f64 / n as f64).clamp(2e-5, 1.0 - 2e-5))).collect();
        // The interpolated quantiles have a slightly different variance, which is scaled to 1.
        let variance: f64 =
            table.windows(2).map(|w| (w[0] * w[0] + w[0] * w[1] + w[1] * w[1]) / 3.0).sum::<f64>() / n as f64;
        table.iter_mut().for_each(|x| *x /= variance.sqrt());
        Self(table.windows(2).map(|w| [w[0] as f32, w[1] as f32 - w[0] as f32]).collect())
    }

    /// The normal number of these bits.
    #[inline]
    pub(super) fn at(&self, bits: u32) -> f32 {
        Self::between(self.0[(bits >> 20) as usize], bits)
    }

    /// The normal number of these bits, given their table cell.
    #[inline(always)]
    fn between([low, step]: [f32; 2], bits: u32) -> f32 {
        low + (bits & 0xF_FFFF) as i32 as f32 * (1.0 / (1 << 20) as f32) * step
    }
}

/// The standard normal quantile, by Newton's iteration on the distribution function.
fn quantile(p: f64) -> f64 {
    let mut x = 0.0;
    for _ in 0..100 {
        let cdf = 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
        let density = libm::exp(-0.5 * x * x) / (std::f64::consts::TAU).sqrt();
        let step: f64 = ((cdf - p) / density).clamp(-0.5, 0.5);
        x -= step;
        if step.abs() < 1e-13 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> Imager {
        Imager { automatic: false, prnu: 0.0, dsnu: 0.0, ..Imager::default() }
    }

    fn grey(imager: &Imager, radiance: f32, n: usize) -> (f64, f64) {
        let mut image = vec![radiance; n];
        let exposure = imager.exposed([&image, &image]);
        imager.develop(&mut image, exposure, &imager.pattern([1, 1], 0), 5, Threads::One);
        let mean = image.iter().map(|&x| f64::from(x)).sum::<f64>() / n as f64;
        (mean, image.iter().map(|&x| (f64::from(x) - mean).powi(2)).sum::<f64>() / n as f64)
    }

    #[test]
    fn the_photon_transfer_curve_gives_back_gain_and_read_noise() {
        // Regression: a gain 3 % too high fails this test.
        // σ² = K (μ − black) + K² σ_read² + 1/12, quantised to 12 bits.
        let imager = Imager { bits: 12, gain: 4.0, read_noise: 6.0, black: 10.0, ..quiet() };
        let scale = 4095.0 / 255.0;
        let k = 4095.0 * 4.0 / imager.full_well;
        let points: Vec<(f64, f64)> = [0.0, 0.001, 0.002, 0.004, 0.006, 0.008]
            .map(|radiance| grey(&imager, radiance, 200_000))
            .map(|(mean, variance)| (mean * scale, variance * scale * scale))
            .to_vec();
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
        assert!((slope / k - 1.0).abs() < 0.02, "{slope} for {k}");
        let read = ((points[0].1 - 1.0 / 12.0).sqrt()) / k;
        assert!((read / 6.0 - 1.0).abs() < 0.02, "{read}");
        assert!((points[0].0 - 10.0 * scale).abs() < 0.1);
    }

    #[test]
    fn a_dark_frame_has_the_read_noise_and_the_dark_signal() {
        // The variance without light is K²(σ_read² + σ_dsnu²) + 1/12, and the mean is black. Overexposure gives white
        // without noise.
        let imager = Imager { bits: 12, gain: 8.0, read_noise: 5.0, dsnu: 3.0, black: 20.0, ..quiet() };
        let (width, height) = (400, 250);
        let mut image = vec![0.0; (width * height) as usize];
        let exposure = imager.exposed([&image, &image]);
        imager.develop(&mut image, exposure, &imager.pattern([width, height], 3), 5, Threads::One);
        let scale = 4095.0 / 255.0;
        let n = image.len() as f64;
        let mean = image.iter().map(|&x| f64::from(x) * scale).sum::<f64>() / n;
        let variance = image.iter().map(|&x| (f64::from(x) * scale - mean).powi(2)).sum::<f64>() / n;
        let k = 4095.0 * 8.0 / imager.full_well;
        let exact = k * k * (25.0 + 9.0) + 1.0 / 12.0;
        assert!(
            (variance / exact - 1.0).abs() < 0.02 && (mean - 20.0 * scale).abs() < 0.3,
            "{variance} {exact} {mean}"
        );
        let (white, spread) = grey(&imager, 9.0, 1000);
        assert_eq!((white, spread), (255.0, 0.0));
    }

    #[test]
    fn brightness_grows_with_exposure_and_gain_to_white() {
        let mean = |exposure_ms, gain| grey(&Imager { exposure_ms, gain, ..quiet() }, 0.02, 1000).0;
        assert!(mean(1.0, 1.0) < mean(2.0, 1.0) && mean(2.0, 1.0) < mean(2.0, 2.0));
        assert_eq!(mean(100.0, 2.0), 255.0);
    }

    #[test]
    fn automatic_exposure_reaches_its_target_by_gain_or_by_time() {
        let imager = Imager { prnu: 0.0, ..Imager::default() };
        for radiance in [0.004, 0.02, 0.3] {
            assert!((grey(&imager, radiance, 10_000).0 - (0.8 * 255.0 + 2.0)).abs() < 1.0, "{radiance}");
        }
        let bright = [0.3_f32; 400];
        assert!(imager.exposed([&bright, &bright]).ms < imager.exposure_ms);
        let dark = [0.0_f32; 400];
        assert_eq!(imager.exposed([&dark, &dark]).gain, MAX_GAIN);
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let normal = Normal::new();
        let (mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0);
        for k in 0..400_000 {
            let x = f64::from(normal.at(mix(k, 3, 8)));
            sum += x;
            squares += x * x;
            fourth += x.powi(4);
        }
        let n = 400_000.0;
        assert!((sum / n).abs() < 0.005 && (squares / n - 1.0).abs() < 0.006 && (fourth / n - 3.0).abs() < 0.06);
    }

    #[test]
    fn every_pixel_keeps_its_own_sensitivity() {
        let imager = Imager { prnu: 0.01, dsnu: 0.0, ..Imager::default() };
        let pattern = imager.pattern([200, 100], 7);
        let n = 20_000.0;
        let spread = pattern.response.iter().map(|r| f64::from(r - 1.0).powi(2)).sum::<f64>() / n;
        assert!((spread.sqrt() / 0.01 - 1.0).abs() < 0.03);
        assert!(pattern.dark.is_empty());
    }
}
