//! Where the edges around a corner meet.

use nalgebra::{Matrix2, Vector2};
use seafix_geometry::Pixel;

use crate::Image;

/// Places corners where the edges around them meet: the point p to whose surroundings' gradients
/// the lines towards it are perpendicular, Σ w g gᵀ (x − p) = 0 over the pixels x.
///
/// A Harris response peaks inside a convex corner by 1 to 2 px, at the apex of the blurred edge's
/// curve; the edges themselves still meet at the true corner. The weight
/// w = exp(−r²/2σ²) (1 − exp(−r²/2h²)), h = 0.6 σ, r the distance from p, therefore spares
/// the middle, where blur has rounded the corner off. Gradients are taken at whole pixels and only
/// the weights move with p: nothing is interpolated.
///
/// Source: Förstner and Gülch, *A fast operator for detection and precise location of distinct
/// points, corners and centres of circular features*, ISPRS 1987.
#[derive(Debug)]
pub(super) struct Junction {
    /// −1/2σ² and −1/2σ² − 1/2h² (px⁻²).
    exponents: [f64; 2],
    /// The window ends at this many pixels.
    half: usize,
}

/// How far the junction may lie from the detector's peak (px).
const REACH: f64 = 3.5;
/// The gradients around the peak that some window within reach needs.
const SLACK: usize = 4;

impl Junction {
    /// With windows of standard deviation `sigma` (px).
    pub(super) fn new(sigma: f64) -> Self {
        let sigma = sigma.min(1000.0); // wider than that fits no image
        let outer = -0.5 / (sigma * sigma);
        Self { exponents: [outer, outer / (0.6 * 0.6) + outer], half: libm::ceil(2.5 * sigma) as usize }
    }

    /// The junction near `start`; `None` when there is none within reach, when the edges are parallel,
    /// or when the window leaves the image.
    pub(super) fn near(&self, image: &Image, start: &Pixel) -> Option<Pixel> {
        let (x0, y0) = (libm::round(start.u) as usize, libm::round(start.v) as usize);
        let reach = self.half + SLACK;
        let side = 2 * reach + 1;
        let inside = |x: usize, n: usize| x > reach && x + reach + 1 < n;
        if !(inside(x0, image.width()) && inside(y0, image.height())) {
            return None;
        }
        let gradients = gradients(image, x0 - reach, y0 - reach, side);
        let origin = Vector2::new((x0 - reach) as f64, (y0 - reach) as f64);
        let begin = Vector2::new(start.u, start.v) - origin;
        let mut at = begin;
        for _ in 0..15 {
            let step = self.step(&gradients, side, &at)?;
            at += step;
            if !((at - begin).norm() <= REACH) {
                return None;
            }
            if step.norm_squared() < 1e-6 {
                let place = at + origin;
                return Some(Pixel { u: place.x, v: place.y });
            }
        }
        None
    }

    /// From `at` to the point that the weighted gradients around `at` point to.
    fn step(&self, gradients: &[[f32; 2]], side: usize, at: &Vector2<f64>) -> Option<Vector2<f64>> {
        let corner = |x: f64| libm::round(x) as usize - self.half;
        let (left, top) = (corner(at.x), corner(at.y));
        let width = 2 * self.half + 1;
        let weights = |from: usize, at: f64| -> Vec<[f64; 3]> {
            let weight = |i: usize| {
                let d = i as f64 - at;
                [d, libm::exp(self.exponents[0] * d * d), libm::exp(self.exponents[1] * d * d)]
            };
            (from..from + width).map(weight).collect()
        };
        let (along, down) = (weights(left, at.x), weights(top, at.y));
        let (mut xx, mut xy, mut yy, mut tx, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (j, [dy, outer_y, inner_y]) in down.iter().enumerate() {
            let row = &gradients[(top + j) * side + left..][..width];
            for ([gx, gy], [dx, outer_x, inner_x]) in row.iter().zip(&along) {
                let (gx, gy) = (f64::from(*gx), f64::from(*gy));
                let weight = outer_x * outer_y - inner_x * inner_y;
                let (wx, wy) = (weight * gx, weight * gy);
                let towards = gx * dx + gy * dy;
                xx += wx * gx;
                xy += wx * gy;
                yy += wy * gy;
                tx += wx * towards;
                ty += wy * towards;
            }
        }
        let trace = xx + yy;
        // Edges that cross at less than about 10° meet nowhere in particular.
        if !(xx * yy - xy * xy > 0.01 * trace * trace) {
            return None;
        }
        Matrix2::new(xx, xy, xy, yy).try_inverse().map(|inverse| inverse * Vector2::new(tx, ty))
    }
}

/// Sobel's gradients (grey levels per 8 px) of a square of pixels, row by row.
fn gradients(image: &Image, left: usize, top: usize, side: usize) -> Vec<[f32; 2]> {
    let mut found = Vec::with_capacity(side * side);
    for y in top..top + side {
        let row = |y: usize| &image.row(y)[left - 1..left + side + 1];
        let rows = row(y - 1).windows(3).zip(row(y).windows(3)).zip(row(y + 1).windows(3));
        found.extend(rows.map(|((a, h), b)| {
            let gx = ((a[2] - a[0]) + (b[2] - b[0])) + 2.0 * (h[2] - h[0]);
            let gy = ((b[0] - a[0]) + (b[2] - a[2])) + 2.0 * (b[1] - a[1]);
            [gx, gy]
        }));
    }
    found
}
