//! The model of two blurred edges that meet, with its derivatives.

use std::f32::consts::{LN_2, LOG2_E};

/// The bright sectors between two straight edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// One of four: the corner of a box.
    Wedge,
    /// Two opposite ones: the corner of a chequerboard.
    Crossing,
}

/// The number of parameters, in the order of the derivatives.
pub(super) const PARAMETERS: usize = 7;

/// The model of two blurred edges through one point; the value at x is a + b·U with
///
/// - h_k = t n_kᵀ(x − c), n_k = (cos θ_k, sin θ_k): the distance from edge k in units of the blur 1/t,
/// - U = Φ₂(h₁, h₂; ρ), ρ = n₁ᵀn₂, for a wedge,
/// - U = 4 Φ₂ − 2 Φ(h₁) − 2 Φ(h₂) + 1 for a crossing.
///
/// Φ₂ is the bivariate normal distribution: exactly the indicator of the wedge h₁ > 0, h₂ > 0 convolved with an
/// isotropic Gaussian, for edges at any angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model {
    pub(super) shape: Shape,
    /// The parameters c_x, c_y (px from the window's centre), θ₁, θ₂ (rad), t (px⁻¹), a, b (grey levels).
    pub(super) at: [f64; PARAMETERS],
}

const LANES: usize = 16;
type Lanes = [f32; LANES];

/// The pixels of a square window as lanes: columns and rows from its centre, values, and 1 for a pixel, 0 for padding.
#[derive(Debug, Default)]
pub(super) struct Pixels {
    half: usize,
    x: Vec<Lanes>,
    y: Vec<Lanes>,
    present: Vec<Lanes>,
    pub(super) value: Vec<Lanes>,
    /// The derivatives by the parameters, then the residuals, each as long as the window.
    columns: [Vec<Lanes>; PARAMETERS + 1],
}

/// The normal equations JᵀJ (upper triangle), Jᵀr and rᵀr of the residuals r = value − model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal {
    pub(super) matrix: [[f64; PARAMETERS]; PARAMETERS],
    pub(super) gradient: [f64; PARAMETERS],
    pub(super) squares: f64,
}

impl Pixels {
    /// Sets the window's shape; the caller sets its values.
    pub(super) fn shape(&mut self, half: usize) {
        if self.half == half && !self.x.is_empty() {
            return;
        }
        let side = 2 * half + 1;
        let blocks = (side * side).div_ceil(LANES);
        let place = |i: usize| [i % side, i / side].map(|x| x as f32 - half as f32);
        let lanes = |of: &dyn Fn(usize) -> f32| -> Vec<Lanes> {
            (0..blocks).map(|block| std::array::from_fn(|lane| of(block * LANES + lane))).collect()
        };
        let inside = |i: usize| i < side * side;
        self.half = half;
        self.x = lanes(&|i| if inside(i) { place(i)[0] } else { 0.0 });
        self.y = lanes(&|i| if inside(i) { place(i)[1] } else { 0.0 });
        self.present = lanes(&|i| f32::from(u8::from(inside(i))));
        self.value = lanes(&|_| 0.0);
        self.columns = std::array::from_fn(|_| self.value.clone());
    }

    /// The values as one slice, with the padding at its end.
    pub(super) fn values_mut(&mut self) -> &mut [f32] {
        self.value.as_flattened_mut()
    }

    /// The normal equations of `model`.
    pub(super) fn normal(&mut self, model: &Model) -> Normal {
        let rule = Rule::new(model.at[2], model.at[3]);
        normal(self, model, &rule)
    }
}

/// The Gauss–Legendre rule for the part of Φ₂ that ρ adds to Φ(h₁) Φ(h₂): ∫ exp(−(h₁² + h₂² − 2 h₁ h₂ sin φ) / 2cos²φ)
/// dφ/2π from 0 to arcsin ρ.
struct Rule {
    sine: f64,
    cosine: f64,
    /// The factors of h₁² + h₂² and of h₁ h₂ in the exponent, and the weight.
    nodes: [[f32; 3]; 6],
    count: usize,
}

impl Rule {
    fn new(first: f64, second: f64) -> Self {
        const THREE: [[f64; 2]; 3] =
            [[-0.774_596_669_241_483_4, 5.0 / 9.0], [0.0, 8.0 / 9.0], [0.774_596_669_241_483_4, 5.0 / 9.0]];
        const SIX: [[f64; 2]; 6] = [
            [-0.932_469_514_203_152, 0.171_324_492_379_170_35],
            [-0.661_209_386_466_264_5, 0.360_761_573_048_138_6],
            [-0.238_619_186_083_196_9, 0.467_913_934_572_691_04],
            [0.238_619_186_083_196_9, 0.467_913_934_572_691_04],
            [0.661_209_386_466_264_5, 0.360_761_573_048_138_6],
            [0.932_469_514_203_152, 0.171_324_492_379_170_35],
        ];
        let (cosine, sine) = (libm::cos(first - second), libm::sin(first - second));
        let end = libm::asin(cosine.clamp(-1.0, 1.0));
        let rule: &[[f64; 2]] = if end.abs() < 0.35 { &THREE } else { &SIX };
        let mut nodes = [[0.0; 3]; 6];
        for (node, [x, weight]) in nodes.iter_mut().zip(rule) {
            let angle = 0.5 * end * (x + 1.0);
            let s = libm::sin(angle);
            let factor = 0.5 / (1.0 - s * s);
            *node = [-factor, 2.0 * s * factor, 0.5 * end * weight / std::f64::consts::TAU].map(|v| v as f32);
        }
        Self { sine, cosine, nodes, count: rule.len() }
    }
}

/// The exponential of x ≤ 0, accurate to 2e-7.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// A constant whose addition rounds to integers, which appear in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = if x > -80.0 { x } else { -80.0 };
    let rounded = x * LOG2_E + ROUND;
    let r = x - (rounded - ROUND) * LN_2;
    let p = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}

/// The normal distribution Φ and exp(−x²/2), accurate to 2e-7.
///
/// Source: Abramowitz and Stegun, *Handbook of mathematical functions*, 7.1.26.
#[inline(always)]
fn phi(x: f32) -> (f32, f32) {
    let bell = exp(-0.5 * x * x);
    let t = 1.0 / (1.0 + (0.327_591_1 * std::f32::consts::FRAC_1_SQRT_2) * x.abs());
    let sum = t * (0.254_829_6 + t * (-0.284_496_72 + t * (1.421_413_8 + t * (-1.453_152_1 + t * 1.061_405_4))));
    let tail = 0.5 * sum * bell;
    (if x >= 0.0 { 1.0 - tail } else { tail }, bell)
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn normal(pixels: &mut Pixels, model: &Model, rule: &Rule) -> Normal {
    const TAU: f32 = std::f32::consts::TAU;
    const ROOT: f32 = 0.398_942_3; // 1/√2π
    let [cx, cy, first, second, t, a, b] = model.at;
    let [(c1, s1), (c2, s2)] = [first, second].map(|angle| (libm::cos(angle) as f32, libm::sin(angle) as f32));
    let [cx, cy, t, a, b] = [cx, cy, t, a, b].map(|v| v as f32);
    let (rho, sine) = (rule.cosine as f32, rule.sine as f32);
    let (inverse, wide) = (1.0 / sine.abs().max(1e-3), 1.0 / t);
    let crossing = model.shape == Shape::Crossing;
    let (scale, flat) = if crossing { (4.0, 2.0) } else { (1.0, 0.0) };
    let constant = if crossing { 1.0 } else { 0.0 };
    let Pixels { x, y, present, value, columns, .. } = pixels;
    for (i, (((x, y), on), value)) in x.iter().zip(&*y).zip(&*present).zip(&*value).enumerate() {
        let (mut h1, mut h2) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let (dx, dy) = (x[lane] - cx, y[lane] - cy);
            h1[lane] = t * (c1 * dx + s1 * dy);
            h2[lane] = t * (c2 * dx + s2 * dy);
        }
        let mut beyond = [0.0; LANES];
        for [square, cross, weight] in &rule.nodes[..rule.count] {
            for lane in 0..LANES {
                let (h1, h2) = (h1[lane], h2[lane]);
                beyond[lane] += weight * exp(square * (h1 * h1 + h2 * h2) + cross * (h1 * h2));
            }
        }
        // A local buffer cannot alias; otherwise the loop would not be vectorised.
        let mut out = [[0.0; LANES]; PARAMETERS + 1];
        for lane in 0..LANES {
            let (dx, dy, h1, h2) = (x[lane] - cx, y[lane] - cy, h1[lane], h2[lane]);
            let ((p1, bell1), (p2, bell2)) = (phi(h1), phi(h2));
            let (q1, tail) = phi((h2 - rho * h1) * inverse);
            let (q2, _) = phi((h1 - rho * h2) * inverse);
            let u = scale * (p1 * p2 + beyond[lane]) - flat * (p1 + p2) + constant;
            // ∂Φ₂/∂h₁ = φ(h₁) Φ(k₁), k₁ = (h₂ − ρh₁)/√(1 − ρ²), and ∂Φ₂/∂ρ = φ(h₁) φ(k₁)/√(1 − ρ²).
            let d1 = b * ROOT * bell1 * (scale * q1 - flat);
            let d2 = b * ROOT * bell2 * (scale * q2 - flat);
            let density = b * scale * bell1 * tail * inverse * (1.0 / TAU);
            let on = on[lane];
            out[0][lane] = -on * t * (d1 * c1 + d2 * c2);
            out[1][lane] = -on * t * (d1 * s1 + d2 * s2);
            // ρ = cos(θ₁ − θ₂)
            out[2][lane] = on * (d1 * t * (c1 * dy - s1 * dx) - density * sine);
            out[3][lane] = on * (d2 * t * (c2 * dy - s2 * dx) + density * sine);
            out[4][lane] = on * (d1 * h1 + d2 * h2) * wide;
            out[5][lane] = on;
            out[6][lane] = on * u;
            out[7][lane] = on * (value[lane] - (a + b * u));
        }
        columns.iter_mut().zip(out).for_each(|(column, out)| column[i] = out);
    }
    let mut matrix = [[0.0; PARAMETERS]; PARAMETERS];
    let mut gradient = [0.0; PARAMETERS];
    for i in 0..PARAMETERS {
        for j in i..PARAMETERS {
            matrix[i][j] = dot(&columns[i], &columns[j]);
            matrix[j][i] = matrix[i][j];
        }
        gradient[i] = dot(&columns[i], &columns[PARAMETERS]);
    }
    Normal { matrix, gradient, squares: dot(&columns[PARAMETERS], &columns[PARAMETERS]) }
}

#[inline(always)]
fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            sums[lane] += sums[lane + width];
        }
        width /= 2;
    }
    f64::from(sums[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: [f64; PARAMETERS] = [0.3, -0.4, 0.2, 1.5, 1.2, 90.0, 60.0];

    /// The model's values at the pixels: the negative residuals of a window of zeros.
    fn values(model: &Model) -> Vec<f32> {
        let mut pixels = Pixels::default();
        pixels.shape(5);
        pixels.normal(model);
        pixels.columns[PARAMETERS].as_flattened()[..121].iter().map(|r| -r).collect()
    }

    #[test]
    fn the_wedge_is_a_blurred_indicator() {
        // The reference sums the Gaussian over a fine grid.
        for second in [1.5, 2.7, 0.6] {
            let at = [0.3, -0.4, 0.2, second, 1.2, 10.0, 100.0];
            let model = Model { shape: Shape::Wedge, at };
            let found = values(&model);
            let normals = [0.2, second].map(|angle: f64| [angle.cos(), angle.sin()]);
            for (i, found) in found.iter().enumerate().step_by(7) {
                let (x, y) = ((i % 11) as f64 - 5.0, (i / 11) as f64 - 5.0);
                let (mut inside, mut all) = (0.0, 0.0);
                for j in 0..160_000 {
                    let (u, v) = ((j % 400) as f64 / 50.0 - 3.99, (j / 400) as f64 / 50.0 - 3.99);
                    let weight = (-0.5 * (u * u + v * v)).exp();
                    let (px, py) = (x + u / 1.2 - 0.3, y + v / 1.2 + 0.4);
                    all += weight;
                    if normals.iter().all(|n| n[0] * px + n[1] * py > 0.0) {
                        inside += weight;
                    }
                }
                let expected = 10.0 + 100.0 * inside / all;
                assert!((f64::from(*found) - expected).abs() < 0.1, "{second} {i}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn the_crossing_is_a_product_where_edges_are_perpendicular() {
        let at = [0.3, -0.4, 0.2, 0.2 + std::f64::consts::FRAC_PI_2, 1.2, 90.0, 60.0];
        let found = values(&Model { shape: Shape::Crossing, at });
        for (i, found) in found.iter().enumerate() {
            let (x, y) = ((i % 11) as f64 - 5.3, (i / 11) as f64 - 4.6);
            let [h1, h2] = [[0.2_f64.cos(), 0.2_f64.sin()], [-0.2_f64.sin(), 0.2_f64.cos()]]
                .map(|n| libm::erf(1.2 * (n[0] * x + n[1] * y) / 2.0_f64.sqrt()));
            assert!((f64::from(*found) - (90.0 + 60.0 * h1 * h2)).abs() < 1e-3);
        }
    }

    #[test]
    fn derivatives_are_differences() {
        for shape in [Shape::Wedge, Shape::Crossing] {
            for parameter in 0..PARAMETERS {
                let moved = |by: f64| {
                    let mut at = EXAMPLE;
                    at[parameter] += by;
                    values(&Model { shape, at })
                };
                let (less, more) = (moved(-0.003), moved(0.003));
                let mut pixels = Pixels::default();
                pixels.shape(5);
                pixels.normal(&Model { shape, at: EXAMPLE });
                for i in 0..121 {
                    let found = pixels.columns[parameter].as_flattened()[i];
                    let expected = (more[i] - less[i]) / 0.006;
                    assert!(
                        (found - expected).abs() < 0.03 + 2e-3 * expected.abs(),
                        "{shape:?} {parameter} {i}: {found} for {expected}"
                    );
                }
            }
        }
    }
}
