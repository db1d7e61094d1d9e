//! What all that join a fix with what was known have in common: the gate, and the pose between the two.

use nalgebra::{Matrix3, Matrix6, Vector6};
use seafix_geometry::{Covariance6, so3::skew};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Contradiction;
use crate::Standing;

/// Whether a fix agrees with what was known: rᵀ (Σ_known + Σ_fix)⁻¹ r ≤ χ²₆(`confidence`), r = log(T_known⁻¹ T_fix).
pub(super) fn gate(known: &Standing, fix: &Standing, confidence: f64) -> Result<(), Contradiction> {
    let six = ChiSquared::new(6.0).expect("six degrees of freedom");
    let limit = six.inverse_cdf(confidence);
    let innovation = known.object_from_camera.error_to(&fix.object_from_camera);
    let fix_here = carried_back(&fix.covariance.matrix, &innovation);
    let nis = (known.covariance.matrix + fix_here)
        .cholesky()
        .map_or(f64::INFINITY, |sum| innovation.dot(&sum.solve(&innovation)));
    if nis <= limit { Ok(()) } else { Err(Contradiction { nis, limit }) }
}

/// Two rounds settle it: an innovation within the gate is a few standard deviations.
const ROUNDS: usize = 3;

/// The pose with the least w₁ ‖log(T_known⁻¹ T)‖² + w₂ ‖log(T_fix⁻¹ T)‖², each in its own metric; `None` where a
/// covariance is singular.
pub(super) fn joined(known: &Standing, fix: &Standing, weights: [f64; 2]) -> Option<Standing> {
    let known_information = known.covariance.matrix.try_inverse()? * weights[0];
    let fix_information = fix.covariance.matrix.try_inverse()? * weights[1];
    let mut pose = known.object_from_camera;
    let mut information = known_information;
    for _ in 0..ROUNDS {
        let mut gradient = Vector6::zeros();
        information = Matrix6::zeros();
        for (from, weight) in
            [(&known.object_from_camera, &known_information), (&fix.object_from_camera, &fix_information)]
        {
            let residual = from.error_to(&pose);
            let jacobian = right_jacobian_inverse(&residual);
            gradient += jacobian.transpose() * weight * residual;
            information += jacobian.transpose() * weight * jacobian;
        }
        pose = pose.perturbed(&-(information.cholesky()?.solve(&gradient))).renormalized();
    }
    let covariance = Covariance6::new(information.cholesky()?.inverse());
    // Of what was known so much stays as it weighed.
    let shares = covariance.matrix * known_information * known.shares;
    Some(Standing { object_from_camera: pose, covariance, shares })
}

/// The covariance of η in Exp(r) Exp(η) = Exp(r + J_r(r)⁻¹ η), as one of the sum.
pub(super) fn carried_back(covariance: &Matrix6<f64>, r: &Vector6<f64>) -> Matrix6<f64> {
    let jacobian = right_jacobian_inverse(r);
    jacobian * covariance * jacobian.transpose()
}

/// J_r(ξ)⁻¹ = I + ad/2 + ad²/12 − ad⁴/720 + …, ad = \[\[φ\]×, 0; \[ρ\]×, \[φ\]×\].
fn right_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    let turn: Matrix3<f64> = skew(&xi.fixed_rows::<3>(0).into_owned());
    let shift: Matrix3<f64> = skew(&xi.fixed_rows::<3>(3).into_owned());
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    ad.fixed_view_mut::<3, 3>(3, 0).copy_from(&shift);
    let square = ad * ad;
    Matrix6::identity() + ad * 0.5 + square * (1.0 / 12.0) - square * square * (1.0 / 720.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, Transform};

    #[test]
    fn the_jacobian_meets_differences() {
        let xi = Vector6::from([0.3, -0.2, 0.4, 0.5, -0.6, 0.7]);
        let start = Transform::<Camera, Camera>::exp(&xi);
        let jacobian = right_jacobian_inverse(&xi);
        for i in 0..6 {
            let mut step = Vector6::zeros();
            step[i] = 1e-6;
            let slope = (start.perturbed(&step).log() - start.perturbed(&-step).log()) / 2e-6;
            assert!((slope - jacobian.column(i)).norm() < 1e-4, "{i}");
        }
    }
}
