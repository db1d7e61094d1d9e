//! What all that join a fix with what was known have in common: the gate, and the pose between the two.

use nalgebra::{Matrix6, Vector6};
use seafix_geometry::{Covariance6, right_jacobian_inverse};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Contradiction;
use crate::Standing;

/// Whether a fix agrees with what was known: rᵀ (Σ_known + Σ_fix)⁻¹ r ≤ χ²₆(`confidence`), r = log(T_known⁻¹ T_fix).
pub(crate) fn gate(known: &Standing, fix: &Standing, confidence: f64) -> Result<(), Contradiction> {
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
