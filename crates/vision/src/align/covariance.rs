//! The covariance of an alignment.

use nalgebra::{Matrix2, Matrix4, SMatrix, Vector2, Vector4};

use super::window::Normal;

/// The residual between two aligned windows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residual {
    /// The residual energy Σ w (Ĩ − T̃)², with Σ w = 1.
    pub(super) energy: f64,
    /// The variance of the right window (squared grey levels).
    pub(super) variance: f64,
    /// The interpolation fractions of the right window, if they are the same for all its pixels.
    pub(super) fractions: Option<[f64; 2]>,
    /// The sum of the squared weights, Σ w².
    pub(super) squared_weights: f64,
    /// The variance of rounding, a lower bound of the noise (squared grey levels).
    pub(super) rounding: f64,
}

/// The prior standard deviation of deformations about zero.
const SLOPE: f64 = 0.15;

/// The covariance of the aligned position (px²) in pixels of the left image; `None` if the window is noise alone.
///
/// Noise of variance σ² in both images, with T of variance s_T² and I of s_I² scaled to 1, moves the position by δ =
/// G⁻¹ Σ w J̃ᵀ(ñ_T − ñ_I), so Cov δ = σ² (1/s_T² + 1/s_I²) G⁻¹ (Σ w² J̃ᵀJ̃) G⁻¹. Three corrections apply:
///
/// - G is Σ w J̃ᵀJ̃ without the contribution of noise, since noise in J̃ does not recur in the other image.
/// - The noise part of Σ w² J̃ᵀJ̃ counts with the right image's noise alone; with its own it forms an odd sum, which
///   vanishes.
/// - Interpolation keeps a fraction q of the noise ([`kept`]) in the residual and in products with noise, but not in
///   products with the scene, whose frequencies are low: σ² = Σ w (Ĩ − T̃)² / (1/s_T² + q/s_I²), corrected for the
///   fitted parameters.
pub(super) fn covariance<const P: usize>(normal: &Normal<P>, residual: &Residual) -> Option<Matrix2<f64>> {
    let (left, right) = (1.0 / normal.variance, 1.0 / residual.variance);
    let kept = residual.fractions.map_or(MEAN_KEPT * MEAN_KEPT, |[x, y]| kept(x) * kept(y));
    let free = 1.0 - (P + 2) as f64 * residual.squared_weights;
    let noise = residual.energy / (left + kept * right) / free.max(0.1);
    let noise = noise.max(residual.rounding);
    let signal: SMatrix<f64, P, P> = normal.information - normal.noise * (noise * left);
    let prior = normal.prior(residual.energy);
    let inverse = (signal + prior).cholesky()?.inverse();
    let of_noise = normal.noise_spread * (noise * left);
    let spread = (normal.spread - of_noise) * (left + right) + of_noise * (kept * right);
    let all = inverse * (spread * noise + prior * prior * (SLOPE * SLOPE)) * inverse;
    let place: Matrix2<f64> = all.fixed_view::<2, 2>(0, 0).into();
    Some((place + place.transpose()) * 0.5)
}

/// The slant estimated at the end of an alignment by translation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slant {
    /// The error that the slant causes in the translated window's position (px of the left image).
    pub(super) off: Vector2<f64>,
    /// Rao's score: χ² with two degrees of freedom if there is no slant.
    score: f64,
}

impl Slant {
    /// Whether the slant is significant: 95 % of windows without a slant have a smaller score.
    pub(super) fn is_seen(&self) -> bool {
        self.score > 5.99
    }

    /// The fraction of the slant that is not noise; the mean score without a slant is 2.
    pub(super) fn fraction(&self) -> f64 {
        (1.0 - 2.0 / self.score).max(0.0).sqrt()
    }
}

/// The slant at the end of an alignment by translation; `None` if the window is noise alone.
///
/// The slant's own part is u = g_s − G_sm G_mm⁻¹ g_m, with g the gradient of the four parameters and G their
/// information. Its covariance is σ² (1/s_T² + 1/s_I²) T (Σ w² J̃ᵀJ̃) Tᵀ with T = (−G_sm G_mm⁻¹, 1).
pub(super) fn slant(normal: &Normal<4>, gradient: &Vector4<f64>, residual: &Residual) -> Option<Slant> {
    let block = |all: &Matrix4<f64>, i, j| all.fixed_view::<2, 2>(i, j).into_owned();
    let within = block(&normal.information, 0, 0).try_inverse()?;
    let across = block(&normal.information, 2, 0) * within;
    let own = gradient.fixed_rows::<2>(2) - across * gradient.fixed_rows::<2>(0);
    let spread = block(&normal.spread, 2, 2)
        - across * block(&normal.spread, 0, 2)
        - block(&normal.spread, 2, 0) * across.transpose()
        + across * block(&normal.spread, 0, 0) * across.transpose();
    let free = (1.0 - 6.0 * residual.squared_weights).max(0.1);
    let rounding = (1.0 / normal.variance + 1.0 / residual.variance) * residual.rounding;
    let noise = (residual.energy / free).max(rounding);
    let score = (spread * noise).cholesky().map_or(0.0, |factor| own.dot(&factor.solve(&own)));
    let information = block(&normal.information, 2, 2) - across * block(&normal.information, 0, 2);
    let slope = (information + block(&normal.prior(residual.energy), 2, 2)).try_inverse()? * own;
    Some(Slant { off: across.transpose() * slope, score })
}

/// The variance of white noise that interpolation at the fraction t keeps: Σ_k η(t − k)², a cubic in t (1 − t).
///
/// η is the cardinal cubic spline.
fn kept(t: f64) -> f64 {
    let p = t * (1.0 - t);
    1.0 - p * p * (3.0 + 3.607_695_15 * p)
}

/// The mean of [`kept`] over all fractions.
const MEAN_KEPT: f64 = 0.874_23;

#[cfg(test)]
mod tests {
    use super::*;

    /// The cardinal spline η(t − k), by the prefilter's exact response.
    fn cardinal(t: f64, k: i32) -> f64 {
        let beta = |x: f64| match x.abs() {
            x if x < 1.0 => 2.0 / 3.0 - x * x + 0.5 * x * x * x,
            x if x < 2.0 => (2.0 - x).powi(3) / 6.0,
            _ => 0.0,
        };
        let root = 3f64.sqrt();
        (-30..=30).map(|j: i32| root * (root - 2.0).powi((j - k).abs()) * beta(t - f64::from(j))).sum()
    }

    #[test]
    fn interpolation_keeps_the_fraction_of_noise_that_the_cardinal_spline_does() {
        for t in [0.0, 0.1, 0.25, 0.5, 0.9] {
            let sum: f64 = (-25..=25).map(|k| cardinal(t, k).powi(2)).sum();
            assert!((kept(t) - sum).abs() < 1e-6, "{t}: {} not {sum}", kept(t));
        }
        let mean = (0..1000).map(|i| kept((f64::from(i) + 0.5) / 1000.0)).sum::<f64>() / 1000.0;
        assert!((MEAN_KEPT - mean).abs() < 1e-4, "{mean}");
    }
}
