//! The structure tensor, streamed: from an image to a response at every pixel.

use serde::{Deserialize, Serialize};

use super::strip::{Band, Part, Planes, STRIP, strip};
use crate::{Image, gaussian::half_kernel};

/// The weights that integrate the structure tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Window {
    /// A Gaussian, cut off at 3σ: the same in every direction.
    #[default]
    Gaussian,
    /// A square of equal weights and the same variance, σ² = (n² − 1)/12 for n pixels. Of whole grey
    /// levels the sums are exact, and a quarter turn of the image turns the response to the last bit.
    Box,
}

/// What a structure tensor A says of its pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measure {
    /// det A − k (tr A)², Harris and Stephens (grey levels⁴/px⁴).
    Harris { k: f32 },
    /// The smaller eigenvalue, Shi and Tomasi (grey levels²/px²).
    SmallestEigenvalue,
}

/// A = w ∗ g gᵀ, the gradient g by Sobel's operator (grey levels/px).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tensor {
    pub(super) window: Window,
    /// Standard deviation of the window (px).
    pub(super) sigma: f64,
    pub(super) measure: Measure,
}

/// The response, some rows after the other: what the window needs of the rows before stays.
#[derive(Debug, Default)]
pub(super) struct Stream {
    products: [Vec<f32>; 3],
    /// Of each strip the rows under the window.
    rings: Vec<Planes>,
    /// The first row of the image that the rings do not hold yet.
    next: usize,
    /// The greatest response so far.
    pub(super) strongest: f32,
}

/// The weights of a window along one axis.
#[derive(Debug)]
pub(super) struct Weights {
    of: (Window, f64),
    /// Of the centre, and of each step away from it.
    pub(super) half: Vec<f32>,
    /// What both axes together have to be scaled by.
    pub(super) scale: f32,
}

impl Weights {
    pub(super) fn new(window: Window, sigma: f64) -> Self {
        let of = (window, sigma);
        match window {
            Window::Gaussian => Self { of, half: half_kernel(sigma), scale: 1.0 },
            Window::Box => {
                let reach = libm::round(((12.0 * sigma * sigma + 1.0).sqrt() - 1.0) / 2.0) as usize;
                let n = 2 * reach + 1;
                Self { of, half: vec![1.0; reach + 1], scale: 1.0 / (n * n) as f32 }
            }
        }
    }

    pub(super) fn reach(&self) -> usize {
        self.half.len() - 1
    }

    /// Pixels at the border without a response: the window's and the gradient's.
    pub(super) fn margin(&self) -> usize {
        self.reach() + 1
    }
}

impl Tensor {
    /// The weights of the window, made anew only if others are `kept`; `None` if the image is too small for the operator.
    pub(super) fn weights<'a>(&self, image: &Image, kept: &'a mut Option<Weights>) -> Option<&'a Weights> {
        let shorter = image.width().min(image.height());
        // Checked before the weights are made: their number is the user's.
        if !(2.0 * self.sigma < shorter as f64) {
            return None;
        }
        if kept.as_ref().is_none_or(|weights| weights.of != (self.window, self.sigma)) {
            *kept = Some(Weights::new(self.window, self.sigma));
        }
        kept.as_ref().filter(|weights| shorter > 2 * weights.margin())
    }
}

impl Stream {
    /// What came before is forgotten.
    pub(super) fn begin(&mut self) {
        (self.next, self.strongest) = (0, 0.0);
    }

    /// Fills `out` with the response at whole rows of the image, the first of which is `first`; zero nearer to the
    /// border than the operator reaches. The rows follow those of the call before, or are the first.
    pub(super) fn fill(&mut self, image: &Image, tensor: &Tensor, weights: &Weights, first: usize, out: &mut [f32]) {
        let (width, height) = (image.width(), image.height());
        let (margin, reach) = (weights.margin(), weights.reach());
        let end = first + out.len() / width;
        for (y, row) in (first..).zip(out.chunks_exact_mut(width)) {
            if y < margin || y >= height - margin {
                row.fill(0.0);
            } else {
                row[..margin].fill(0.0);
                row[width - margin..].fill(0.0);
            }
        }
        let rows = first.max(margin)..end.min(height - margin);
        if rows.is_empty() {
            return;
        }
        let size = 2 * reach + 1;
        self.products.iter_mut().for_each(|plane| plane.resize(STRIP + 2 * reach, 0.0));
        self.rings.resize(size * (width - 2 * margin).div_ceil(STRIP), Planes::ZERO);
        let next = if self.next == rows.start + reach { self.next } else { rows.start - reach };
        self.next = rows.end + reach;
        let Self { products, rings, strongest, .. } = self;
        let strips = (margin..width - margin).step_by(STRIP);
        for (left, ring) in strips.zip(rings.chunks_exact_mut(size)) {
            let columns = left..(left + STRIP).min(width - margin);
            let part = Part { image, weights, measure: tensor.measure, first, rows: rows.clone(), next, columns };
            strip(&part, out, Band { products, ring, strongest });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::random_image;

    /// The response at every pixel, so many rows at a time.
    fn response(tensor: &Tensor, image: &Image, rows: usize) -> (Vec<f32>, f32) {
        let mut response = vec![7.0; image.pixels().len()];
        let (mut weights, mut stream) = (None, Stream { strongest: 9.0, ..Stream::default() });
        let weights = tensor.weights(image, &mut weights).expect("an image large enough");
        stream.begin();
        for (index, out) in response.chunks_mut(rows * image.width()).enumerate() {
            stream.fill(image, tensor, weights, index * rows, out);
        }
        (response, stream.strongest)
    }

    /// The response at a pixel as the definition has it, in f64.
    fn by_definition(tensor: &Tensor, image: &Image, x: usize, y: usize) -> f64 {
        let weights = Weights::new(tensor.window, tensor.sigma);
        let reach = weights.reach() as isize;
        let pixel = |x: isize, y: isize| f64::from(image.row(y as usize)[x as usize]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))) {
            let (x, y) = (x as isize + dx, y as isize + dy);
            let side = |dx: isize| pixel(x + dx, y - 1) + 2.0 * pixel(x + dx, y) + pixel(x + dx, y + 1);
            let end = |dy: isize| pixel(x - 1, y + dy) + 2.0 * pixel(x, y + dy) + pixel(x + 1, y + dy);
            let (gx, gy) = ((side(1) - side(-1)) / 8.0, (end(1) - end(-1)) / 8.0);
            let weight = |d: isize| f64::from(weights.half[d.unsigned_abs()]);
            let weight = weight(dx) * weight(dy) * f64::from(weights.scale);
            xx += weight * gx * gx;
            xy += weight * gx * gy;
            yy += weight * gy * gy;
        }
        match tensor.measure {
            Measure::Harris { k } => (xx * yy - xy * xy) - f64::from(k) * (xx + yy) * (xx + yy),
            Measure::SmallestEigenvalue => 0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt(),
        }
    }

    const MEASURES: [Measure; 2] = [Measure::Harris { k: 0.04 }, Measure::SmallestEigenvalue];

    #[test]
    fn it_is_the_definition_at_every_pixel_however_many_rows_at_a_time() {
        for (window, sigma, reach) in [
            (Window::Gaussian, 0.3, 1),
            (Window::Gaussian, 1.0, 3),
            (Window::Gaussian, 2.0, 6),
            (Window::Box, 0.3, 0),
            (Window::Box, 2.0, 3),
        ] {
            for (measure, (width, height)) in MEASURES.into_iter().zip([(163, 33), (31, 60)]) {
                let (tensor, image) = (Tensor { window, sigma, measure }, random_image(width, height));
                let (found, strongest) = response(&tensor, &image, height);
                let margin = reach + 1;
                let inner = |at: usize, n: usize| at >= margin && at + margin < n;
                for (i, &r) in found.iter().enumerate() {
                    let (x, y) = (i % width, i / width);
                    if inner(x, width) && inner(y, height) {
                        let expected = by_definition(&tensor, &image, x, y);
                        let size = if measure == Measure::SmallestEigenvalue { 5e3 } else { 2.5e7 };
                        assert!((f64::from(r) - expected).abs() < 2e-6 * size, "{tensor:?} {x} {y}: {r} {expected}");
                    } else {
                        assert_eq!(r, 0.0);
                    }
                }
                assert_eq!(strongest, found.iter().copied().fold(0.0, f32::max));
                for rows in [1, 7, 20] {
                    assert_eq!((&found, strongest), (&response(&tensor, &image, rows).0, strongest), "{rows} rows");
                }
            }
        }
    }

    #[test]
    fn the_box_has_the_variance_asked_for() {
        for n in [1_usize, 3, 5, 7, 21] {
            let sigma = ((n * n - 1) as f64 / 12.0).sqrt();
            assert_eq!(Weights::new(Window::Box, sigma).reach(), n / 2);
        }
    }
}
