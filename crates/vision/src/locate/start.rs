//! The initial guess of the edges at a corner.

use multiversion::multiversion;
use nalgebra::{Complex, Matrix2, Vector2};

use super::model::{Model, Shape};
use crate::image::Image;

/// The initial guess: two edges and the statistics of the four sectors between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    /// The intersection of the edges.
    pub(super) at: Vector2<f64>,
    /// The directions of the edges' normals (rad).
    pub(super) normals: [f64; 2],
    /// The statistics of the four sectors.
    sectors: [Sector; 4],
    /// The sum of the squared deviations of all pixels from their mean.
    variation: f64,
}

/// The pixels of one sector.
#[derive(Debug, Clone, Copy, Default)]
struct Sector {
    count: f64,
    sum: f64,
}

impl Start {
    /// The edges in the square of side 2·`half` + 1, at most [`MAX`], around the pixel (x, y).
    ///
    /// The square and one pixel more must lie in the image. `None` if there are fewer than two edges. They intersect at
    /// the point nearest to the lines of the gradients, Σ g gᵀ(x − p) = 0. Their directions are those of two edges that
    /// explain the moments mₖ = Σ |g|² z^k, z = exp(2i·arg g), of the gradients: z₁ and z₂ are the roots of z² − S z +
    /// P with m₁ = S m₀ − P m̄₁ and m₂ = S m₁ − P m₀ (Prony's method).
    pub(super) fn of(image: &Image, x: usize, y: usize, half: usize) -> Option<Self> {
        let square = Square::cut(image, x, y, half);
        let [xx, xy, yy, xd, yd, fourth_x, fourth_y] = moments(&square).map(f64::from);
        let tensor = Matrix2::new(xx, xy, xy, yy);
        let m0 = tensor.trace();
        let m1 = Complex::new(xx - yy, 2.0 * xy);
        let m2 = Complex::new(fourth_x, fourth_y);
        let determinant = m0 * m0 - m1.norm_sqr();
        if !(determinant > 0.02 * m0 * m0) {
            return None;
        }
        let sum = (m1 * m0 - m2 * m1.conj()) / determinant;
        let product = (m1 * m1 - m2 * m0) / determinant;
        let root = (sum * sum - product * 4.0).sqrt();
        let normals = [sum + root, sum - root].map(|z| 0.5 * libm::atan2(z.im, z.re));
        let at = tensor.try_inverse()? * Vector2::new(xd, yd);
        let (sectors, variation) = parts(&square, &normals, &at);
        Some(Self { at, normals, sectors, variation })
    }

    /// The best guess of two flat regions with a sharp border, over the orientations of the bright region.
    pub(super) fn guess(&self, shape: Shape) -> Guess {
        let mut best = Guess { shape, ..Guess::NONE };
        let wedges: &[usize] = if shape == Shape::Wedge { &[1, 2, 4, 8] } else { &[9] };
        for &mask in wedges {
            let [mut bright, mut dark] = [Sector::default(); 2];
            for (i, sector) in self.sectors.iter().enumerate() {
                let part = if mask >> i & 1 == 1 { &mut bright } else { &mut dark };
                part.count += sector.count;
                part.sum += sector.sum;
            }
            if bright.count.min(dark.count) < 3.0 {
                continue;
            }
            let (inside, outside) = (bright.sum / bright.count, dark.sum / dark.count);
            let difference = inside - outside;
            let between = difference * difference * bright.count * dark.count / (bright.count + dark.count);
            let explained = between / self.variation;
            if explained > best.explained {
                const PI: f64 = std::f64::consts::PI;
                // The sector's index has one bit for the side of each edge.
                let turn = |edge: usize| {
                    let behind = shape == Shape::Wedge && mask & (if edge == 0 { 0b1010 } else { 0b1100 }) == 0;
                    self.normals[edge] + if behind { PI } else { 0.0 }
                };
                best = Guess { shape, explained, normals: [turn(0), turn(1)], levels: [outside, inside] };
            }
        }
        best
    }
}

/// A corner without blur.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guess {
    shape: Shape,
    /// The fraction of the window's variance that the guess explains.
    pub(super) explained: f64,
    normals: [f64; 2],
    /// The grey levels outside and inside.
    levels: [f64; 2],
}

impl Guess {
    pub(super) const NONE: Self = Self { shape: Shape::Wedge, explained: 0.0, normals: [0.0; 2], levels: [0.0; 2] };

    /// The difference between the two regions (grey levels).
    pub(super) fn contrast(&self) -> f64 {
        (self.levels[1] - self.levels[0]).abs()
    }

    /// The initial model of a fit: a corner at this position with a medium blur.
    pub(super) fn model(&self, at: [f64; 2]) -> Model {
        let ([outside, inside], [first, second]) = (self.levels, self.normals);
        let [a, b] = match self.shape {
            Shape::Wedge => [outside, inside - outside],
            Shape::Crossing => [0.5 * (inside + outside), 0.5 * (inside - outside)],
        };
        Model { shape: self.shape, at: [at[0], at[1], first, second, 1.0, a, b] }
    }
}

/// The largest side of a square.
pub(super) const MAX: usize = 31;
const LANES: usize = 16;
/// A row of a square with one pixel more on either side, and padding for the lanes.
type Row = [f32; 2 * LANES + 2];

/// A square of pixels, less the value of the middle one, with one pixel around it.
struct Square {
    half: usize,
    middle: f32,
    rows: [Row; MAX + 2],
}

impl Square {
    fn cut(image: &Image, x: usize, y: usize, half: usize) -> Self {
        let (wide, middle) = (2 * half + 3, image.row(y)[x]);
        let mut square = Self { half, middle, rows: [[0.0; 2 * LANES + 2]; MAX + 2] };
        for (row, y) in square.rows[..wide].iter_mut().zip(y - half - 1..) {
            row[..wide].copy_from_slice(&image.row(y)[x - half - 1..][..wide]);
            row[..wide].iter_mut().for_each(|value| *value -= middle);
        }
        square
    }
}

/// The sums over the square of gx², gx gy, gy², gx gᵀd, gy gᵀd (d from the centre) and of |g|² exp(4i·arg g).
///
/// The gradients are Sobel's (grey levels per 8 px).
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn moments(square: &Square) -> [f32; 7] {
    let side = 2 * square.half + 1;
    let mut sums = [[0.0_f32; LANES]; 7];
    for first in (0..side).step_by(LANES) {
        for j in 0..side {
            let lanes =
                |j: usize, i: usize| -> [f32; LANES] { std::array::from_fn(|lane| square.rows[j][first + i + lane]) };
            let ([a0, a1, a2], [h0, h2], [b0, b1, b2]) = (
                [lanes(j, 0), lanes(j, 1), lanes(j, 2)],
                [lanes(j + 1, 0), lanes(j + 1, 2)],
                [lanes(j + 2, 0), lanes(j + 2, 1), lanes(j + 2, 2)],
            );
            let dy = j as f32 - square.half as f32;
            let mut terms = [[0.0; LANES]; 7];
            for lane in 0..LANES {
                let inside = if first + lane < side { 1.0 } else { 0.0 };
                let gx = inside * ((a2[lane] - a0[lane]) + (b2[lane] - b0[lane]) + 2.0 * (h2[lane] - h0[lane]));
                let gy = inside * ((b0[lane] - a0[lane]) + (b2[lane] - a2[lane]) + 2.0 * (b1[lane] - a1[lane]));
                let dx = (first + lane) as f32 - square.half as f32;
                let along = gx * dx + gy * dy;
                let (gxx, gxy, gyy) = (gx * gx, gx * gy, gy * gy);
                let (re, im) = (gxx - gyy, 2.0 * gxy);
                let scale = 1.0 / (gxx + gyy + 1.0);
                terms[0][lane] = gxx;
                terms[1][lane] = gxy;
                terms[2][lane] = gyy;
                terms[3][lane] = gx * along;
                terms[4][lane] = gy * along;
                terms[5][lane] = (re * re - im * im) * scale;
                terms[6][lane] = 2.0 * re * im * scale;
            }
            for (sum, term) in sums.as_flattened_mut().iter_mut().zip(terms.as_flattened()) {
                *sum += term;
            }
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// The four sectors of the square between edges through `at` with these normals, and the square's variation.
fn parts(square: &Square, normals: &[f64; 2], at: &Vector2<f64>) -> ([Sector; 4], f64) {
    let [n1, n2] = normals.map(|angle| [libm::cos(angle) as f32, libm::sin(angle) as f32]);
    let [counts, sums, [squares, ..]] =
        part_sums(square, n1, n2, [at.x as f32, at.y as f32]).map(|row| row.map(f64::from));
    let (count, sum) = (counts.iter().sum::<f64>(), sums.iter().sum::<f64>());
    let sectors =
        std::array::from_fn(|i| Sector { count: counts[i], sum: sums[i] + counts[i] * f64::from(square.middle) });
    (sectors, squares - sum * sum / count)
}

/// The number and the sum of the pixels of each sector, then the sum of all squares.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn part_sums(square: &Square, n1: [f32; 2], n2: [f32; 2], at: [f32; 2]) -> [[f32; 4]; 3] {
    let side = 2 * square.half + 1;
    // The pixels of all, beyond the first edge, beyond the second, beyond both: counts, then sums; then squares.
    let mut all = [[0.0_f32; LANES]; 9];
    for first in (0..side).step_by(LANES) {
        for j in 0..side {
            let values: [f32; LANES] = std::array::from_fn(|lane| square.rows[j + 1][first + 1 + lane]);
            let dy = j as f32 - square.half as f32 - at[1];
            let mut terms = [[0.0; LANES]; 9];
            for lane in 0..LANES {
                let dx = (first + lane) as f32 - square.half as f32 - at[0];
                let inside = if first + lane < side { 1.0 } else { 0.0 };
                let one = if n1[0] * dx + n1[1] * dy > 0.0 { inside } else { 0.0 };
                let two = if n2[0] * dx + n2[1] * dy > 0.0 { inside } else { 0.0 };
                let value = values[lane];
                terms[0][lane] = inside;
                terms[1][lane] = one;
                terms[2][lane] = two;
                terms[3][lane] = one * two;
                terms[4][lane] = inside * value;
                terms[5][lane] = one * value;
                terms[6][lane] = two * value;
                terms[7][lane] = one * two * value;
                terms[8][lane] = inside * (value * value);
            }
            for (sum, term) in all.as_flattened_mut().iter_mut().zip(terms.as_flattened()) {
                *sum += term;
            }
        }
    }
    let [n, n1, n2, n12, s, s1, s2, s12, squares] = all.map(|lanes| lanes.iter().sum::<f32>());
    [
        [n - n1 - n2 + n12, n1 - n12, n2 - n12, n12],
        [s - s1 - s2 + s12, s1 - s12, s2 - s12, s12],
        [squares, 0.0, 0.0, 0.0],
    ]
}
