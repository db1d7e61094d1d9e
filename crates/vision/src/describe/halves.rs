//! Successive halves of an image, for windows much larger than a pixel.

use multiversion::multiversion;
use seafix_geometry::Pixel;

use super::cells::Grid;
use crate::image::Image;

/// Successive halves of an image, in which each pixel is the mean of 2×2 of the one before.
///
/// The last pixel of an odd side counts twice.
#[derive(Debug, Default)]
pub(super) struct Halves {
    levels: Vec<(usize, Vec<f32>)>,
    filled: usize,
}

/// The threshold of the cell width (px): cells of at least twice this width use the next smaller image.
const FINEST: f64 = 3.0;
/// The maximum number of halves.
const MAX: usize = 16;

/// The number of halvings for cells of this width.
fn halvings(step: f64) -> usize {
    (0..MAX).take_while(|&level| step >= 2.0 * FINEST * (1_u64 << level) as f64).count()
}

impl Halves {
    /// Halves an image as often as cells of this width need.
    pub(super) fn fill(&mut self, image: &Image, step: f64) {
        self.filled = halvings(step);
        self.levels.resize_with(self.filled.max(self.levels.len()), Default::default);
        for level in 0..self.filled {
            let (finer, coarser) = self.levels.split_at_mut(level);
            match finer.last() {
                Some((width, pixels)) => halve(pixels, *width, &mut coarser[0]),
                None => halve(image.pixels(), image.width(), &mut coarser[0]),
            }
        }
    }

    /// The grid, with the pixels and the width of the image in which its cells are a few pixels wide.
    pub(super) fn at<'a>(&'a self, image: &'a Image, at: Pixel, step: f64) -> (Grid, &'a [f32], usize) {
        let level = halvings(step).min(self.filled);
        let pixel = (1_u64 << level) as f64;
        // The centre of the first pixel is that of the first 2×2, 4×4, …
        let place = |x: f64| (x - 0.5 * (pixel - 1.0)) / pixel;
        let grid = Grid::new(Pixel { u: place(at.u), v: place(at.v) }, step / pixel);
        match level.checked_sub(1).map(|level| &self.levels[level]) {
            Some((width, pixels)) => (grid, pixels, *width),
            None => (grid, image.pixels(), image.width()),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn halve(pixels: &[f32], width: usize, (half, out): &mut (usize, Vec<f32>)) {
    *half = width.div_ceil(2);
    let height = pixels.len() / width;
    out.resize(*half * height.div_ceil(2), 0.0);
    for (out, y) in out.chunks_exact_mut(*half).zip((0..).step_by(2)) {
        let upper = &pixels[y * width..][..width];
        let lower = &pixels[(y + 1).min(height - 1) * width..][..width];
        for ((out, upper), lower) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
            *out = 0.25 * ((upper[0] + upper[1]) + (lower[0] + lower[1]));
        }
        if width % 2 == 1 {
            out[*half - 1] = 0.5 * (upper[width - 1] + lower[width - 1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_is_the_mean_of_four() {
        let mut half = Default::default();
        halve(&[1.0, 2.0, 3.0, 5.0, 6.0, 7.0, 9.0, 8.0, 4.0], 3, &mut half);
        assert_eq!(half, (2, vec![3.5, 5.0, 8.5, 4.0]));
    }

    #[test]
    fn a_ramp_keeps_its_values_at_every_level() {
        let ramp = Image::new(256, 256, (0..65536).map(|i| (2 * (i % 256) + i / 256) as f32).collect()).unwrap();
        let mut halves = Halves::default();
        halves.fill(&ramp, 30.0);
        for step in [1.0, 5.9, 6.0, 11.0, 13.0, 24.0, 30.0] {
            let (grid, pixels, width) = halves.at(&ramp, Pixel { u: 120.3, v: 130.6 }, step);
            let mut cells = [[0.0; 2]; 2];
            grid.turned(pixels, width, [0.6, 0.8], &mut Vec::new(), &mut cells);
            let slope = f64::from(cells[1][0] - cells[0][0]) / step;
            assert!((slope - (2.0 * 0.6 + 0.8)).abs() < 1e-4, "{step}: {slope}");
            // Cells are relative to the grey level of the pixel at the centre.
            let pixel = (256 / width) as f64;
            let nearest = |x: f64| libm::round((x - 0.5 * (pixel - 1.0)) / pixel) as usize;
            let grey = pixels[nearest(130.6) * width + nearest(120.3)];
            let mean = f64::from(grey + 0.25 * cells.as_flattened().iter().sum::<f32>());
            assert!((mean - (2.0 * 120.3 + 130.6)).abs() < 1e-3, "{step}: {mean}");
        }
        assert_eq!(halvings(f64::NAN), 0);
        assert_eq!(halvings(f64::INFINITY), MAX);
    }
}
