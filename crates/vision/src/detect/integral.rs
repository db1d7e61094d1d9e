//! The integral image: sums over rectangles in constant time.

use multiversion::multiversion;

use crate::image::Image;

/// The integral image in integer units, modulo 2³².
///
/// The unit is a power of two of a grey level. It is so small that integer grey levels are exact, and so large that no
/// sum over a rectangle of the largest area reaches 2³⁰. Differences are therefore exact although the sums overflow.
///
/// Source: Viola and Jones, *Rapid object detection using a boosted cascade of simple features*, 2001.
#[derive(Debug, Default)]
pub(super) struct Integral {
    width: usize,
    height: usize,
    sums: Vec<u32>,
}

impl Integral {
    /// Integrates an image for rectangles of at most `area` pixels; returns the unit (grey levels).
    pub(super) fn fill(&mut self, image: &Image, area: f64) -> f32 {
        let [darkest, brightest] = range(image.pixels());
        // The largest number of units in a grey level, bounded so that the scaling stays finite.
        let max = (1_u32 << 30) as f64 / area - 1.0;
        let units = power_below(max / (f64::from(brightest) - f64::from(darkest))).clamp(UNITS[0], UNITS[1]) as f32;
        self.reset(image.width(), image.height());
        let columns = self.width + 1;
        let mut above_and_below = self.sums.as_mut_slice();
        for y in 0..self.height {
            let (above, rest) = above_and_below.split_at_mut(columns);
            sum_row(image.row(y), units, darkest * units, above, &mut rest[..columns]);
            above_and_below = rest;
        }
        1.0 / units
    }

    /// Integrates the image of `other` with 2×2 pixels summed to one.
    pub(super) fn fill_half(&mut self, other: &Self) {
        self.reset(other.width / 2, other.height / 2);
        for (row, y) in self.sums.chunks_exact_mut(self.width + 1).zip((0..).step_by(2)) {
            for (sum, pair) in row.iter_mut().zip(other.row(y).chunks(2)) {
                *sum = pair[0];
            }
        }
    }

    /// Sets the size and clears the first row.
    fn reset(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.sums.resize((width + 1) * (height + 1), 0);
        self.sums[..=width].fill(0);
    }

    /// The numbers of pixels along x and y.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The sums above pixel row `y`: at the left corner of every pixel, and at the right corner of the last.
    pub(super) fn row(&self, y: usize) -> &[u32] {
        &self.sums[y * (self.width + 1)..][..=self.width]
    }
}

/// The smallest and the largest number of units in a grey level.
const UNITS: [f64; 2] = [f64::from_bits((1023 - 120) << 52), f64::from_bits((1023 + 100) << 52)];

/// The largest power of two that does not exceed a positive number.
fn power_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & (0x7FF << 52))
}

/// The minimum and the maximum.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn range(pixels: &[f32]) -> [f32; 2] {
    let (mut min, mut greatest) = ([pixels[0]; 16], [pixels[0]; 16]);
    let mut blocks = pixels.chunks_exact(16);
    for block in &mut blocks {
        for (i, &pixel) in block.iter().enumerate() {
            min[i] = if pixel < min[i] { pixel } else { min[i] };
            greatest[i] = if pixel > greatest[i] { pixel } else { greatest[i] };
        }
    }
    let mut both = [pixels[0]; 2];
    for &pixel in min.iter().chain(&greatest).chain(blocks.remainder()) {
        both = [both[0].min(pixel), both[1].max(pixel)];
    }
    both
}

/// Computes a row of the integral from the row above.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn sum_row(pixels: &[f32], units: f32, darkest: f32, above: &[u32], row: &mut [u32]) {
    row[0] = 0;
    let sums = &mut row[1..];
    for (sum, pixel) in sums.iter_mut().zip(pixels) {
        *sum = (pixel * units - darkest + 0.5) as i32 as u32;
    }
    let mut sum = 0_u32;
    for (out, above) in sums.iter_mut().zip(&above[1..]) {
        sum = sum.wrapping_add(*out);
        *out = above.wrapping_add(sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(integral: &Integral, [x0, x1]: [usize; 2], [y0, y1]: [usize; 2]) -> i32 {
        let (top, bottom) = (integral.row(y0), integral.row(y1));
        bottom[x1].wrapping_sub(bottom[x0]).wrapping_sub(top[x1].wrapping_sub(top[x0])) as i32
    }

    #[test]
    fn rectangles_have_their_sums() {
        let image = Image::new(3, 2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        let mut integral = Integral::default();
        let unit = integral.fill(&image, 6.0);
        // The darkest pixel counts as zero.
        assert_eq!(over(&integral, [0, 3], [0, 2]) as f32 * unit, 21.0 - 6.0);
        assert_eq!(over(&integral, [1, 3], [0, 1]) as f32 * unit, 2.0 + 3.0 - 2.0);
        let mut half = Integral::default();
        half.fill_half(&integral);
        assert_eq!(half.size(), [1, 1]);
        assert_eq!(over(&half, [0, 1], [0, 1]) as f32 * unit, 1.0 + 2.0 + 4.0 + 5.0 - 4.0);
    }

    #[test]
    fn sums_that_overflow_have_exact_differences() {
        let pixels: Vec<f32> = (0..300 * 200).map(|i| ((i * 7919) % 256) as f32).collect();
        let image = Image::new(300, 200, pixels).unwrap();
        let mut integral = Integral::default();
        let unit = integral.fill(&image, 400.0);
        assert!(over(&integral, [0, 300], [0, 200]) as f32 * unit < 1e6, "the total sum does not overflow");
        for (x, y) in [(0, 0), (280, 180), (133, 77)] {
            let expected: f32 = (y..y + 20).map(|y| image.row(y)[x..x + 20].iter().sum::<f32>()).sum();
            assert_eq!(over(&integral, [x, x + 20], [y, y + 20]) as f32 * unit, expected);
        }
    }

    #[test]
    fn any_finite_image_has_an_integral() {
        for extreme in [0.0, 1e-45, 1e-30, 1e30, f32::MAX] {
            let image = Image::new(2, 2, vec![extreme, -extreme, extreme, 0.0]).unwrap();
            let mut integral = Integral::default();
            let unit = integral.fill(&image, 4.0);
            assert!(unit.is_finite() && unit > 0.0 && (0..4).contains(&(over(&integral, [0, 1], [0, 2]) >> 28)));
        }
    }
}
