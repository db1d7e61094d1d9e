//! Windows: weights, and the template with its derivatives.

use nalgebra::{SMatrix, Vector2};
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

use super::{
    lanes::{dot, dot3},
    spline::copy,
    warp::Model,
};
use crate::image::Image;

/// Weights of a window's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Weight {
    /// Equal weights, in proportion for pixels that the window's border cuts.
    Uniform,
    /// A Gaussian of standard deviation side / 3 about the centre.
    #[default]
    Gaussian,
}

/// The pixels around a position in row-major order, with each row padded by zero weights to a multiple of 8.
#[derive(Debug, Default)]
pub(super) struct Grid {
    /// The offset from the position to the first pixel.
    pub(super) first: [f64; 2],
    /// The number of pixels in a row without padding.
    pub(super) side: usize,
    /// The number of pixels in a row with padding.
    pub(super) columns: usize,
    /// The first pixel in the image.
    corner: [isize; 2],
    /// The weights, with sum 1.
    pub(super) weights: Vec<f32>,
    axes: [Vec<f32>; 2],
}

impl Grid {
    /// Sets the grid of a window with this half-side (px, integer) around `centre`.
    pub(super) fn place(&mut self, centre: &Vector2<f64>, half: usize, weight: Weight) {
        let reach = half as f64 + 1.0;
        self.side = 2 * half + 2;
        self.columns = self.side.next_multiple_of(8);
        let sigma = (half as f64 + 0.5) / 1.5;
        for i in 0..2 {
            // The pixels less than `reach` away: 2 half + 1 or + 2.
            let corner = (centre[i] - reach).floor() + 1.0;
            self.corner[i] = corner as isize;
            self.first[i] = corner - centre[i];
            let along = |k: usize| {
                let x = (self.first[i] + k as f64).abs();
                let inside = (reach - x).clamp(0.0, 1.0);
                inside * if weight == Weight::Gaussian { libm::exp(-0.5 * x * x / (sigma * sigma)) } else { 1.0 }
            };
            self.axes[i].clear();
            self.axes[i].extend((0..self.side).map(|k| along(k) as f32));
            let sum: f32 = self.axes[i].iter().sum();
            self.axes[i].iter_mut().for_each(|w| *w /= sum);
            self.axes[i].resize(self.columns, 0.0);
        }
        self.weights.clear();
        let [x, y] = &self.axes;
        y[..self.side].iter().for_each(|y| self.weights.extend(x.iter().map(|x| x * y)));
    }

    /// The largest offset from the position, with a margin of one pixel.
    pub(super) fn reach(&self) -> f64 {
        self.side as f64 / 2.0
    }
}

/// The left window T̃ with zero mean and unit variance, and its derivatives by P parameters.
///
/// The derivatives are orthogonal to the effects of the free mean and scale.
#[derive(Debug, Default)]
pub(super) struct Template {
    raw: Vec<f32>,
    /// The weighted values T̃.
    pub(super) values: Vec<f32>,
    /// The columns of the Jacobian J̃ in sequence.
    pub(super) jacobian: Vec<f32>,
    /// The weighted columns of J̃.
    pub(super) weighted: Vec<f32>,
}

/// The normal equations of an alignment to the template.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal<const P: usize> {
    /// The information Σ w J̃ᵀJ̃.
    pub(super) information: SMatrix<f64, P, P>,
    /// The contribution to `information` of white noise of variance 1 (of the normalised grey levels).
    pub(super) noise: SMatrix<f64, P, P>,
    /// The matrix Σ w² J̃ᵀJ̃.
    pub(super) spread: SMatrix<f64, P, P>,
    /// The contribution to `spread` of white noise of variance 1.
    pub(super) noise_spread: SMatrix<f64, P, P>,
    /// The variance of the window (squared grey levels).
    pub(super) variance: f64,
}

impl<const P: usize> Normal<P> {
    /// The prior information of the deformation, which is small, for noise of this variance.
    ///
    /// A deformation leaves some windows unchanged, such as the corner of a chessboard scaled along both its edges.
    /// Noise would still seem to determine it, equally in every step. The prior has a tenth of that apparent
    /// information, which is negligible beside a texture's.
    pub(super) fn prior(&self, noise: f64) -> SMatrix<f64, P, P> {
        SMatrix::from_fn(|i, j| if i == j && i >= 2 { 0.1 * noise * self.noise[(i, j)] } else { 0.0 })
    }
}

impl Normal<4> {
    /// The normal equations of translation alone, from those of a slanted window.
    pub(super) fn moving(&self) -> Normal<2> {
        let part = |all: &SMatrix<f64, 4, 4>| all.fixed_view::<2, 2>(0, 0).into_owned();
        Normal {
            information: part(&self.information),
            noise: part(&self.noise),
            spread: part(&self.spread),
            noise_spread: part(&self.noise_spread),
            variance: self.variance,
        }
    }
}

/// The minimum variance of a window: a contrast of a hundredth of a grey level.
pub(super) const MIN_VARIANCE: f64 = 1e-4;

impl Template {
    /// Takes the window on `grid`; `None` if the window leaves the image or is flat.
    pub(super) fn take<const P: usize>(
        &mut self,
        image: &Image,
        grid: &Grid,
        beyond: bool,
        model: &impl Model<P>,
    ) -> Option<Normal<P>> {
        let size = [image.width(), image.height()];
        // Derivatives need a margin of two pixels.
        let inside = (0..2).all(|i| {
            let (first, last) = (grid.corner[i] - 2, grid.corner[i] + grid.side as isize + 1);
            let (first, last) = if beyond { ((first + last) / 2, (first + last) / 2) } else { (first, last) };
            first >= 0 && last < size[i] as isize
        });
        if !inside {
            return None;
        }
        copy(image, grid.corner.map(|c| c - 2), grid.columns + 4, grid.side + 4, &mut self.raw);
        let pixels = grid.columns * grid.side;
        self.values.resize(pixels, 0.0);
        self.jacobian.resize(pixels * P, 0.0);
        self.weighted.resize(pixels * P, 0.0);
        let mut sums = [[0.0; P]; P];
        let mut spread = sums;
        let scale = derive(self, grid, model, &mut sums, &mut spread)?;
        let matrix = |m: [[f32; P]; P]| SMatrix::<f64, P, P>::from_fn(|i, j| f64::from(m[i.min(j)][i.max(j)]));
        let noise = derivative_noise(grid, model, |w| w);
        let noise_spread = derivative_noise(grid, model, |w| w * w);
        let variance = f64::from(1.0 / (scale * scale));
        Some(Normal { information: matrix(sums), noise, spread: matrix(spread), noise_spread, variance })
    }
}

/// The derivative (8 (I₁ − I₋₁) − (I₂ − I₋₂)) / 12 at a pixel.
const DERIVATIVE: [f32; 2] = [8.0 / 12.0, -1.0 / 12.0];
/// The variance of the derivative of white noise of variance 1.
const DERIVATIVE_NOISE: f32 = 2.0 * (DERIVATIVE[0] * DERIVATIVE[0] + DERIVATIVE[1] * DERIVATIVE[1]);

/// The sum Σ f(w) JᵀJ for gradients of noise alone, of variance 1 before the derivative.
fn derivative_noise<const P: usize>(
    grid: &Grid,
    model: &impl Model<P>,
    weight: impl Fn(f32) -> f32,
) -> SMatrix<f64, P, P> {
    // Weights are products of the axes' weights. Moments of second degree suffice: odd ones in x or y vanish, or
    // nearly.
    let [x, y] = [0, 1].map(|i| {
        let weights = grid.axes[i].iter().map(|w| weight(*w));
        let squares = weights.clone().enumerate().map(|(k, w)| {
            let place = (grid.first[i] + k as f64) as f32;
            w * place * place
        });
        [weights.sum::<f32>(), squares.sum::<f32>()]
    });
    let total = x[0] * y[0];
    let (sx, sy) = ((x[1] / x[0]).sqrt(), (y[1] / y[0]).sqrt());
    let mut sum = SMatrix::<f64, P, P>::zeros();
    for gradient in [[1.0, 0.0], [0.0, 1.0]] {
        for place in [[sx, sy], [-sx, sy], [sx, -sy], [-sx, -sy]] {
            let columns = model.columns(place, gradient);
            sum += SMatrix::from_fn(|i, j| f64::from(columns[i] * columns[j]));
        }
    }
    sum * (0.25 * f64::from(total * DERIVATIVE_NOISE))
}

/// Computes the template from its raw pixels; returns its scale.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn derive<const P: usize, M: Model<P>>(
    template: &mut Template,
    grid: &Grid,
    model: &M,
    information: &mut [[f32; P]; P],
    spread: &mut [[f32; P]; P],
) -> Option<f32> {
    let Template { raw, values, jacobian, weighted } = template;
    let (columns, stride) = (grid.columns, grid.columns + 4);
    let weights = &grid.weights[..];
    let pixels = weights.len();
    for (y, to) in values.chunks_exact_mut(columns).enumerate() {
        to.copy_from_slice(&raw[(y + 2) * stride + 2..][..columns]);
    }
    let mean = dot(values, weights);
    values.iter_mut().for_each(|v| *v -= mean);
    let variance = dot3(values, values, weights);
    if !(f64::from(variance) > MIN_VARIANCE && variance.is_finite()) {
        return None;
    }
    let scale = 1.0 / variance.sqrt();
    values.iter_mut().for_each(|v| *v *= scale);
    for y in 0..grid.side {
        let row = |k: usize| &raw[(y + k) * stride..][..stride];
        let (up, above, here, below, down) = (row(0), row(1), row(2), row(3), row(4));
        let step_y = (grid.first[1] + y as f64) as f32;
        let to: [&mut [f32]; P] = {
            let mut parts = jacobian.chunks_exact_mut(pixels);
            std::array::from_fn(|_| &mut parts.next().expect("P columns")[y * columns..][..columns])
        };
        for x in 0..columns {
            let gx = DERIVATIVE[0] * (here[x + 3] - here[x + 1]) + DERIVATIVE[1] * (here[x + 4] - here[x]);
            let gy = DERIVATIVE[0] * (below[x + 2] - above[x + 2]) + DERIVATIVE[1] * (down[x + 2] - up[x + 2]);
            let step_x = grid.first[0] as f32 + x as f32;
            let entries = model.columns([step_x, step_y], [scale * gx, scale * gy]);
            for p in 0..P {
                to[p][x] = entries[p];
            }
        }
    }
    for (column, weighted) in jacobian.chunks_exact_mut(pixels).zip(weighted.chunks_exact_mut(pixels)) {
        let mean = dot(column, weights);
        let along = dot3(column, values, weights);
        for ((j, t), (w, out)) in column.iter_mut().zip(&*values).zip(weights.iter().zip(weighted)) {
            *j -= mean + along * t;
            *out = *j * w;
        }
    }
    for i in 0..P {
        for j in i..P {
            let part = |of: usize| of * pixels..(of + 1) * pixels;
            information[i][j] = dot(&jacobian[part(i)], &weighted[part(j)]);
            spread[i][j] = dot(&weighted[part(i)], &weighted[part(j)]);
        }
    }
    values.iter_mut().zip(weights).for_each(|(v, w)| *v *= w);
    Some(scale)
}
