//! Gaussian image pyramids.

use crate::image::Image;

/// An image and its successive halves; pixel i of a level lies at 2 i of the next finer level.
///
/// Each level is smoothed by (1, 4, 6, 4, 1) / 16 along both axes before every second pixel is taken.
///
/// Source: Burt and Adelson, *The Laplacian pyramid as a compact image code*, 1983.
#[derive(Debug, Default)]
pub struct Pyramid {
    levels: Vec<Image>,
    used: usize,
    row: Vec<f32>,
}

/// The minimum side of a level (px).
const SHORTEST: usize = 16;

impl Pyramid {
    /// The pyramid of `image`, with at most `levels` levels including the image.
    pub fn new(image: &Image, levels: usize) -> Self {
        let mut pyramid = Self::default();
        pyramid.build(image, levels);
        pyramid
    }

    /// Rebuilds the pyramid for `image` and reuses the memory.
    pub fn build(&mut self, image: &Image, levels: usize) {
        let (mut width, mut height) = (image.width(), image.height());
        self.level(0).copy_from(image);
        self.used = 1;
        while self.used < levels && width.min(height) >= 2 * SHORTEST {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            self.level(self.used);
            let (fine, coarse) = self.levels.split_at_mut(self.used);
            let (fine, coarse) = (&fine[self.used - 1], &mut coarse[0]);
            let to = coarse.reshape(width, height);
            halve(fine.pixels(), fine.width(), width, &mut self.row, to);
            self.used += 1;
        }
    }

    /// The levels, finest first.
    pub fn levels(&self) -> &[Image] {
        &self.levels[..self.used]
    }

    fn level(&mut self, index: usize) -> &mut Image {
        while self.levels.len() <= index {
            self.levels.push(Image::blank());
        }
        &mut self.levels[index]
    }
}

/// Halves the smoothed pixels along both axes, mirrored at the border.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn halve(pixels: &[f32], width: usize, to_width: usize, smooth: &mut Vec<f32>, to: &mut [f32]) {
    let height = pixels.len() / width;
    // Two pixels of margin before the first and after the last.
    smooth.resize(2 * to_width + 4, 0.0);
    let sum = |a: f32, b: f32, c: f32, d: f32, e: f32| (6.0 * c + 4.0 * (b + d) + (a + e)) / 16.0;
    for (y, to) in to.chunks_exact_mut(to_width).enumerate() {
        let row = |step: isize| {
            let y = (2 * y as isize + step).unsigned_abs();
            let y = if y < height { y } else { (2 * height - 2 - y).min(height - 1) };
            &pixels[y * width..][..width]
        };
        let (a, b, c, d, e) = (row(-2), row(-1), row(0), row(1), row(2));
        for (x, out) in smooth[2..2 + width].iter_mut().enumerate() {
            *out = sum(a[x], b[x], c[x], d[x], e[x]);
        }
        (smooth[0], smooth[1]) = (smooth[4], smooth[3]);
        for x in width + 2..2 * to_width + 4 {
            smooth[x] = smooth[2 * width + 2 - x];
        }
        for (out, s) in to.iter_mut().zip(smooth.windows(5).step_by(2)) {
            *out = sum(s[0], s[1], s[2], s[3], s[4]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_on_every_second_pixel() {
        let ramp = |x: usize, y: usize| 3.0 * x as f32 + y as f32;
        let image = Image::new(67, 64, (0..67 * 64).map(|i| ramp(i % 67, i / 67)).collect()).unwrap();
        let pyramid = Pyramid::new(&image, 3);
        assert_eq!(
            pyramid.levels().iter().map(|l| (l.width(), l.height())).collect::<Vec<_>>(),
            [(67, 64), (34, 32), (17, 16)]
        );
        assert_eq!(pyramid.levels()[1].row(5)[7], ramp(14, 10));
        assert_eq!(pyramid.levels()[2].row(5)[7], ramp(28, 20));
        // The mirrored kernel (2, 1, 0, 1, 2) · 3 weighs 12 · 3 / 16 at the left border.
        assert_eq!(pyramid.levels()[1].row(5)[0], 10.0 + 2.25);
    }

    #[test]
    fn memory_of_a_greater_image_does_not_show() {
        let image = |side: usize| Image::new(side, side, (0..side * side).map(|i| (i % 7) as f32).collect()).unwrap();
        let mut pyramid = Pyramid::new(&image(80), 4);
        pyramid.build(&image(40), 4);
        assert_eq!(pyramid.levels(), Pyramid::new(&image(40), 4).levels());
        pyramid.build(&image(1), 4);
        assert_eq!(pyramid.levels(), [image(1)]);
    }
}
