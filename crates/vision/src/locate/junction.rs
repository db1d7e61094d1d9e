//! The junction of the edges around a corner.

use nalgebra::{Matrix2, Vector2};
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::Pixel;
use serde::{Deserialize, Serialize};

use super::{
    fit::full,
    locator::{Locator, UncertainPixel},
};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// Förstner's junction: the point nearest to the lines of all edges around it.
///
/// The point p solves Σ w g gᵀ (x − p) = 0 over the pixels x with gradients g. A Harris response peaks 1 to 2 px inside
/// a convex corner, at the apex of the blurred edge's curve, but the edges still intersect at the true corner. The
/// weight w = exp(−r²/2σ²) (1 − exp(−r²/2h²)), h = 0.6 σ, r the distance from p, therefore suppresses the middle, where
/// blur has rounded the corner. Gradients are taken at integer pixels and the weights alone move with p, so nothing is
/// interpolated.
///
/// The covariance is A⁻¹ (Σ w² (gᵀd)² g gᵀ) A⁻¹ with A = Σ w g gᵀ and d = x − p, from the distances of the lines to p.
///
/// It is a junction only if the lines of its edges pass closer to it than their normals: the ratio of Σ w (gᵀd)² to
/// Σ w (g×d)² is at most `max_ratio`. Edges that meet in no point have a larger ratio, and an error above the stated one.
/// A corner that is rounded by some pixels passes the default, which was chosen on the known corners of two renderers in
/// four scenes.
///
/// Source: Förstner and Gülch, *A fast operator for detection and precise location of distinct points, corners and
/// centres of circular features*, ISPRS 1987.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Junction {
    /// Standard deviation σ of the window (px).
    pub sigma: f64,
    /// Maximum of the ratio above, from 0 to 1.
    pub max_ratio: f64,
}

impl Default for Junction {
    fn default() -> Self {
        Self { sigma: 2.5, max_ratio: 0.12 }
    }
}

impl Component for Junction {
    const NAME: &'static str = "junction";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "Förstner's junction: the intersection of the edges around a corner";
    const SOURCE: &'static str =
        "Förstner and Gülch, A fast operator for detection and precise location of distinct points, ISPRS 1987";

    fn check(&self) -> Result<(), String> {
        let Self { sigma, max_ratio } = *self;
        in_range((0.3..=100.0).contains(&sigma), "sigma", sigma, "a number from 0.3 to 100 (px)")?;
        in_range(max_ratio > 0.0 && max_ratio <= 1.0, "max-ratio", max_ratio, "more than 0, at most 1")
    }
}

impl Locator for Junction {
    fn locate_into(
        &self,
        image: &Image,
        keypoints: &[Keypoint],
        work: &mut Workspace,
        places: &mut Vec<Option<UncertainPixel>>,
    ) {
        places.clear();
        places.resize(keypoints.len(), None);
        self.fill(image, keypoints, work, places);
    }
}

impl Junction {
    /// Adds the junctions at the key points without a place.
    pub(super) fn fill(
        &self,
        image: &Image,
        keypoints: &[Keypoint],
        work: &mut Workspace,
        places: &mut [Option<UncertainPixel>],
    ) {
        let window = Window::new(self);
        let gradients: &mut Gradients = work.get();
        for (place, keypoint) in places.iter_mut().zip(keypoints).filter(|(place, _)| place.is_none()) {
            *place = window.near(image, &keypoint.at, gradients);
        }
    }
}

/// The pixels' weights as a function of distance.
struct Window {
    /// The exponents −1/2σ² and −1/2σ² − 1/2h² (px⁻²).
    exponents: [f64; 2],
    /// The half-side of the window (px).
    half: usize,
    max_ratio: f64,
}

/// The gradients of the square around a key point, and the weights of a window's columns and rows.
#[derive(Debug, Default)]
struct Gradients {
    side: usize,
    squares: Vec<[f32; 2]>,
    along: Vec<[f64; 3]>,
    down: Vec<[f64; 3]>,
}

/// The maximum distance of the junction from the detector's peak (px).
const REACH: f64 = 3.5;
/// The margin of the gradients (px), for all windows within reach.
const SLACK: usize = 4;

impl Window {
    fn new(&Junction { sigma, max_ratio }: &Junction) -> Self {
        let outer = -0.5 / (sigma * sigma);
        let exponents = [outer, outer / (0.6 * 0.6) + outer];
        Self { exponents, half: libm::ceil(2.5 * sigma) as usize, max_ratio }
    }

    /// The junction near `start`.
    ///
    /// `None` if there is none within reach, if the edges are parallel, or if the window leaves the image.
    fn near(&self, image: &Image, start: &Pixel, gradients: &mut Gradients) -> Option<UncertainPixel> {
        let reach = self.half + SLACK;
        let [x0, y0] = full([start.u, start.v].map(libm::round), reach + 1, image)?;
        let (left, top) = (x0 - reach, y0 - reach);
        gradients.take(image, left, top, 2 * reach + 1);
        let origin = Vector2::new(left as f64, top as f64);
        let begin = Vector2::new(start.u, start.v) - origin;
        let mut at = begin;
        for _ in 0..15 {
            let sums = self.sums(gradients, &at);
            let inverse = sums.inverse()?;
            let step = inverse * sums.towards;
            at += step;
            if !((at - begin).norm() <= REACH) {
                return None;
            }
            if step.norm_squared() < 1e-6 {
                let place = at + origin;
                let sums = self.sums(gradients, &at);
                if sums.beside > self.max_ratio * sums.along {
                    return None;
                }
                let covariance = inverse * sums.spread * inverse;
                return Some(UncertainPixel { at: Pixel { u: place.x, v: place.y }, covariance });
            }
        }
        None
    }

    /// The sums over the window around `at`.
    fn sums(&self, gradients: &mut Gradients, at: &Vector2<f64>) -> Sums {
        let Gradients { side, squares, along, down } = gradients;
        let corner = |x: f64| libm::round(x) as usize - self.half;
        let (left, top) = (corner(at.x), corner(at.y));
        let width = 2 * self.half + 1;
        for (weights, from, at) in [(&mut *along, left, at.x), (&mut *down, top, at.y)] {
            weights.clear();
            weights.extend((from..from + width).map(|i| {
                let d = i as f64 - at;
                [d, libm::exp(self.exponents[0] * d * d), libm::exp(self.exponents[1] * d * d)]
            }));
        }
        let mut sums = Sums::default();
        for (j, [dy, outer_y, inner_y]) in down.iter().enumerate() {
            let row = &squares[(top + j) * *side + left..][..width];
            for (g, [dx, outer_x, inner_x]) in row.iter().zip(&*along) {
                let g = Vector2::new(f64::from(g[0]), f64::from(g[1]));
                let weight = outer_x * outer_y - inner_x * inner_y;
                let towards = g.x * dx + g.y * dy;
                let square = g * g.transpose();
                sums.tensor += weight * square;
                sums.towards += weight * towards * g;
                sums.spread += weight * weight * towards * towards * square;
                let across = g.x * dy - g.y * dx;
                sums.beside += weight * towards * towards;
                sums.along += weight * across * across;
            }
        }
        sums
    }
}

/// The sums Σ w g gᵀ, Σ w g gᵀ d, Σ w² (gᵀd)² g gᵀ, Σ w (gᵀd)² and Σ w (g×d)² over the pixels of a window, d from its
/// centre.
#[derive(Debug, Default)]
struct Sums {
    tensor: Matrix2<f64>,
    towards: Vector2<f64>,
    spread: Matrix2<f64>,
    beside: f64,
    along: f64,
}

impl Sums {
    fn inverse(&self) -> Option<Matrix2<f64>> {
        let trace = self.tensor.trace();
        // Edges at less than about 10° have no well-determined intersection.
        if !(self.tensor.determinant() > 0.01 * trace * trace) {
            return None;
        }
        self.tensor.try_inverse()
    }
}

impl Gradients {
    /// Computes Sobel's gradients (grey levels per 8 px) of a square of pixels in row-major order.
    fn take(&mut self, image: &Image, left: usize, top: usize, side: usize) {
        self.side = side;
        self.squares.clear();
        for y in top..top + side {
            let row = |y: usize| &image.row(y)[left - 1..left + side + 1];
            let rows = row(y - 1).windows(3).zip(row(y).windows(3)).zip(row(y + 1).windows(3));
            self.squares.extend(rows.map(|((a, h), b)| {
                let gx = ((a[2] - a[0]) + (b[2] - b[0])) + 2.0 * (h[2] - h[0]);
                let gy = ((b[0] - a[0]) + (b[2] - a[2])) + 2.0 * (b[1] - a[1]);
                [gx, gy]
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bright quarter of the plane, x ≥ `x` and y ≥ `y`, blurred by the area of one pixel.
    fn quadrant(x: f64, y: f64, size: usize) -> Image {
        let cover = |i: usize, edge: f64| (i as f64 + 0.5 - edge).clamp(0.0, 1.0);
        let pixel = |i: usize| 50.0 + 100.0 * cover(i % size, x) * cover(i / size, y);
        Image::new(size, size, (0..size * size).map(|i| pixel(i) as f32).collect()).unwrap()
    }

    /// The tangents of a round outline meet in no point: the limit decides how round a corner may be.
    #[test]
    fn a_limit_rejects_round_corners() {
        let found = |radius: f64, max_ratio| {
            // The quarter x, y ≥ 20 with a corner of this radius.
            let centre = 20.0 + radius;
            let pixel = |i: usize| {
                let (x, y) = ((i % 61) as f64, (i / 61) as f64);
                let inside = match x < centre && y < centre {
                    true => radius - libm::hypot(x - centre, y - centre),
                    false => (x - 20.0).min(y - 20.0),
                };
                (120.0 + 60.0 * libm::erf(inside / 1.1)) as f32
            };
            let image = Image::new(61, 61, (0..61 * 61).map(pixel).collect()).unwrap();
            let middle = centre - radius * std::f64::consts::FRAC_1_SQRT_2;
            let peak = Keypoint { at: Pixel { u: middle + 1.0, v: middle + 1.0 }, response: 1.0, scale: 2.0 };
            Junction { max_ratio, ..Junction::default() }.locate(&image, &[peak])[0].is_some()
        };
        for (radius, sharp) in [(0.0, true), (1.0, true), (5.0, false), (8.0, false)] {
            assert_eq!([found(radius, 0.06), found(radius, 1.0)], [sharp, true], "radius {radius} px");
        }
    }

    #[test]
    fn the_corner_of_a_box_is_where_its_edges_meet() {
        for (x, y) in [(20.0, 20.0), (20.5, 19.5), (20.25, 20.7), (19.9, 20.3)] {
            let peak = Pixel { u: libm::floor(x) + 1.2, v: libm::floor(y) + 1.4 };
            let found =
                Junction::default().locate(&quadrant(x, y, 41), &[Keypoint { at: peak, response: 1.0, scale: 2.0 }]);
            let at = found[0].expect("a corner").at;
            assert!(at.distance(&Pixel { u: x, v: y }) < 0.15, "{at:?} for {x}, {y}");
        }
    }
}
