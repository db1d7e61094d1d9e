//! The integral image: sums over rectangles in constant time.

use crate::Image;

/// The integral ∫∫ of an image whose pixels are squares of constant grey, continued beyond the border
/// by its outermost pixels.
///
/// Source: Viola and Jones, *Rapid object detection using a boosted cascade of simple features*, 2001.
#[derive(Debug)]
pub(super) struct Integral {
    columns: usize,
    width: usize,
    height: usize,
    sums: Vec<f64>,
}

impl Integral {
    pub(super) fn of(image: &Image) -> Self {
        let (width, height) = (image.width(), image.height());
        let columns = width + 1;
        let mut sums = vec![0.0; columns * (height + 1)];
        for y in 0..height {
            let (done, rest) = sums.split_at_mut((y + 1) * columns);
            let (above, row) = (&done[y * columns..], &mut rest[..columns]);
            let mut sum = 0.0;
            for ((out, &above), &pixel) in row[1..].iter_mut().zip(&above[1..]).zip(image.row(y)) {
                sum += f64::from(pixel);
                *out = above + sum;
            }
        }
        Self { columns, width, height, sums }
    }

    /// The cell of an edge coordinate and the place in it. Beyond the border the cell is the outermost
    /// and the place lies outside 0..1: linear continuation of the integral is constant continuation
    /// of the image.
    pub(super) fn cell(x: f64, cells: usize) -> (usize, f64) {
        // A cast truncates and saturates: negative and not-a-number give 0.
        let cell = (x as usize).min(cells - 1);
        (cell, x - cell as f64)
    }

    /// Cells along x and y.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The integral from the image's corner to the place in these cells (see [`cell`](Self::cell)),
    /// exact for any fraction.
    pub(super) fn to(&self, (column, fx): (usize, f64), (row, fy): (usize, f64)) -> f64 {
        let upper = &self.sums[row * self.columns + column..][..2];
        let lower = &self.sums[(row + 1) * self.columns + column..][..2];
        let a = upper[0] + fx * (upper[1] - upper[0]);
        let b = lower[0] + fx * (lower[1] - lower[0]);
        a + fy * (b - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_have_their_sums_even_beyond_the_border() {
        let image = Image::new(3, 2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        let integral = Integral::of(&image);
        let to = |x: f64, y: f64| integral.to(Integral::cell(x, 3), Integral::cell(y, 2));
        let over = |x0: f64, y0: f64, x1: f64, y1: f64| to(x1, y1) - to(x0, y1) - to(x1, y0) + to(x0, y0);
        assert_eq!(over(0.0, 0.0, 3.0, 2.0), 21.0);
        assert_eq!(over(0.5, 0.0, 2.0, 1.0), 0.5 + 2.0);
        assert_eq!(over(1.0, 0.5, 2.0, 2.0), 1.0 + 5.0);
        assert_eq!(over(-2.0, 0.0, 0.0, 1.0), 2.0, "the first pixel continues to the left");
        assert_eq!(over(3.0, 2.0, 5.0, 3.0), 12.0, "the last one beyond the corner");
    }
}
