//! The structure tensor's response at every pixel of an image, streamed.

use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use super::strip::{Band, Part, Planes, STRIP, strip};
use crate::{gaussian::half_kernel, image::Image};

/// Window that integrates the structure tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Window {
    /// A Gaussian, cut off at 3σ; the same in every direction.
    #[default]
    Gaussian,
    /// A square of n×n equal weights with the variance σ² = (n² − 1)/12.
    ///
    /// Sums of integer grey levels are exact, so a quarter turn of the image turns the response to the last bit.
    Box,
}

/// The response of a structure tensor A.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measure {
    /// Harris and Stephens' det A − k (tr A)² (grey levels⁴/px⁴).
    Harris { k: f32 },
    /// Shi and Tomasi's smaller eigenvalue (grey levels²/px²).
    SmallestEigenvalue,
}

/// The structure tensor A = w ∗ g gᵀ, with the gradient g by Sobel's operator (grey levels/px).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tensor {
    pub(super) window: Window,
    /// Standard deviation of the window (px).
    pub(super) sigma: f64,
    pub(super) measure: Measure,
}

/// The response by consecutive rows; the window's part of the earlier rows is kept.
#[derive(Debug, Default)]
pub(super) struct Stream {
    products: [Vec<f32>; 3],
    /// The rows under the window, for each strip.
    rings: Vec<Planes>,
    /// The first image row that is not yet in the rings.
    next: usize,
    /// The strongest response so far.
    pub(super) strongest: f32,
}

/// The weights of a window along one axis.
#[derive(Debug)]
pub(super) struct Weights {
    of: (Window, f64),
    /// The weight of the centre, then of each step from it.
    pub(super) half: Vec<f32>,
    /// The scale factor of both axes together.
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

    /// The width of the border without a response (px): the window's and the gradient's.
    pub(super) fn margin(&self) -> usize {
        self.reach() + 1
    }
}

impl Tensor {
    /// The weights of the window, recomputed only if `kept` holds others.
    ///
    /// `None` if the image is too small for the operator.
    pub(super) fn weights<'a>(&self, image: &Image, kept: &'a mut Option<Weights>) -> Option<&'a Weights> {
        let shorter = image.width().min(image.height());
        // Checked before the weights are computed, since the user sets their number.
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
    /// Resets the stream.
    pub(super) fn begin(&mut self) {
        (self.next, self.strongest) = (0, 0.0);
    }

    /// Fills `out` with the response of complete image rows from `first` on.
    ///
    /// The response is zero nearer to the border than the operator reaches. Rows follow those of the last call, or are
    /// the first.
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

    /// The response at every pixel, computed `rows` rows at a time.
    fn response(tensor: &Tensor, image: &Image, rows: usize) -> (Vec<f32>, f32) {
        let mut response = vec![7.0; image.pixels().len()];
        let (mut weights, mut stream) = (None, Stream { strongest: 9.0, ..Stream::default() });
        let weights = tensor.weights(image, &mut weights).expect("the image is large enough");
        stream.begin();
        for (index, out) in response.chunks_mut(rows * image.width()).enumerate() {
            stream.fill(image, tensor, weights, index * rows, out);
        }
        (response, stream.strongest)
    }

    /// The response at a pixel by its definition, in f64.
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
