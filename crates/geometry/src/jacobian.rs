//! The inverse right Jacobian of SE(3).

use nalgebra::{Matrix6, Vector6};

use crate::so3::skew;

/// The inverse right Jacobian J_r(ξ)⁻¹ of SE(3), in closed form for |φ| < 2π.
///
/// It is defined by log(Exp(ξ) Exp(η)) = ξ + J_r(ξ)⁻¹ η + O(η²) with ξ = (φ, ρ):
///
/// J_r⁻¹ = I + ad/2 + A ad² + B ad⁴, ad = \[\[φ\]×, 0; \[ρ\]×, \[φ\]×\]; with θ = |φ|, α = (θ/2) cot(θ/2) and β =
/// (θ/2)²/sin²(θ/2): A = 2(1 − α)/θ² + (α − β)/(2θ²), B = (1 − α)/θ⁴ + (α − β)/(2θ⁴).
///
/// Source: Bullo and Murray, *Proportional derivative (PD) control on the Euclidean group*, European Control Conference
/// 1995.
pub fn right_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    let turn = skew(&xi.fixed_rows::<3>(0).into_owned());
    let shift = skew(&xi.fixed_rows::<3>(3).into_owned());
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    ad.fixed_view_mut::<3, 3>(3, 0).copy_from(&shift);
    let square = ad * ad;
    let [a, b] = coefficients(xi.fixed_rows::<3>(0).norm());
    Matrix6::identity() + ad * 0.5 + square * a + square * square * b
}

/// The coefficients A and B at the angle θ.
///
/// Near zero the quotients lose digits and their series are used. With 1 − α = Σ aₖ θ²ᵏ, aₖ = |B₂ₖ|/(2k)!, and α − β =
/// θ dα/dθ they are Σ (2 − k) aₖ θ²ᵏ⁻² and Σ (1 − k) aₖ θ²ᵏ⁻⁴.
fn coefficients(theta: f64) -> [f64; 2] {
    let t2 = theta * theta;
    if theta < 0.3 {
        const A: [f64; 6] = [
            1.0 / 12.0,
            1.0 / 720.0,
            1.0 / 30_240.0,
            1.0 / 1_209_600.0,
            1.0 / 47_900_160.0,
            691.0 / 1_307_674_368_000.0,
        ];
        let a = A[0] - t2 * t2 * (A[2] + t2 * (2.0 * A[3] + t2 * 3.0 * A[4]));
        let b = -(A[1] + t2 * (2.0 * A[2] + t2 * (3.0 * A[3] + t2 * (4.0 * A[4] + t2 * 5.0 * A[5]))));
        return [a, b];
    }
    let (sine, cosine) = (libm::sin(0.5 * theta), libm::cos(0.5 * theta));
    let alpha = 0.5 * theta * cosine / sine;
    let beta = t2 / (4.0 * sine * sine);
    [(2.0 * (1.0 - alpha) + 0.5 * (alpha - beta)) / t2, (1.0 - alpha + 0.5 * (alpha - beta)) / (t2 * t2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{frame::Camera, transform::Transform};

    #[test]
    fn it_is_the_slope_of_the_logarithm() {
        for size in [1e-4, 0.1, 0.29, 0.31, 1.0, 3.0] {
            let xi = Vector6::from([0.5, -0.4, 0.768, 0.5, -0.6, 0.7]) * size;
            let start = Transform::<Camera, Camera>::exp(&xi);
            let jacobian = right_jacobian_inverse(&xi);
            for i in 0..6 {
                let mut step = Vector6::zeros();
                step[i] = 1e-5;
                let slope = (start.perturbed(&step).log() - start.perturbed(&-step).log()) / 2e-5;
                assert!((slope - jacobian.column(i)).norm() < 1e-8, "{size} {i}: {}", slope - jacobian.column(i));
            }
        }
    }

    #[test]
    fn series_and_quotients_meet() {
        let [below, above] = [0.3 - 1e-12, 0.3 + 1e-12].map(coefficients);
        assert!((below[0] - above[0]).abs() < 1e-13 && (below[1] - above[1]).abs() < 1e-13, "{below:?} {above:?}");
    }
}
