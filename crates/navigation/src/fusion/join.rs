//! The innovation gate, and the combinations of a fix with the known pose.

use nalgebra::{Matrix6, Vector6};
use seafix_geometry::{Covariance6, right_jacobian_inverse};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::rule::Contradiction;
use crate::{chain::ObjectPose, consider_states::ConsiderStates};

/// The χ² gate of a fix: rᵀ S⁻¹ r ≤ χ²₆(`confidence`) with r = log(T_known⁻¹ T_fix).
///
/// S is the covariance of r, including the cross-covariance of both poses.
pub(crate) fn gate(known: &ObjectPose, fix: &ObjectPose, confidence: f64) -> Result<(), Contradiction> {
    let six = ChiSquared::new(6.0).expect("six degrees of freedom");
    let limit = six.inverse_cdf(confidence);
    let innovation = known.object_from_camera.error_to(&fix.object_from_camera);
    let nis = Innovation::of(known, fix)
        .covariance
        .cholesky()
        .map_or(f64::INFINITY, |all| innovation.dot(&all.solve(&innovation)));
    if nis <= limit { Ok(()) } else { Err(Contradiction { nis, limit }) }
}

/// The innovation r = log(T_known⁻¹ T_fix) = ξ_known − F ξ_fix with F = J_r(r)⁻¹, and its covariance.
struct Innovation {
    r: Vector6<f64>,
    /// The matrix F.
    back: Matrix6<f64>,
    /// The cross-covariance X = E[ξ_known (F ξ_fix)ᵀ].
    common: Matrix6<f64>,
    /// The covariance S = Σ_known + F Σ_fix Fᵀ − X − Xᵀ.
    covariance: Matrix6<f64>,
}

impl Innovation {
    fn of(known: &ObjectPose, fix: &ObjectPose) -> Self {
        let r = known.object_from_camera.error_to(&fix.object_from_camera);
        let back = right_jacobian_inverse(&r);
        let common = known.consider_states.common(&fix.consider_states) * back.transpose();
        let own = back * fix.covariance.matrix * back.transpose();
        let covariance = known.covariance.matrix + own - common - common.transpose();
        Self { r, back, common, covariance }
    }
}

/// The minimum-variance pose of the two, with its consider states:
///
/// K = (Σ_known − X) S⁻¹, ξ = (I − K) ξ_known + K F ξ_fix about T_known Exp(K r).
///
/// The covariance holds for every gain K (Joseph's form). `None` if S is singular.
pub(super) fn consider_states(known: &ObjectPose, fix: &ObjectPose) -> Option<ObjectPose> {
    let Innovation { r, back, common, covariance } = Innovation::of(known, fix);
    let gain = covariance.cholesky()?.solve(&(known.covariance.matrix - common).transpose()).transpose();
    let step = gain * r;
    // T_known Exp(ξ_known) = T_known Exp(step) Exp(ξ), hence ξ = J_r(step) (ξ_known − step).
    let about = right_jacobian_inverse(&step).try_inverse()?;
    let (stay, go) = (about * (Matrix6::identity() - gain), about * gain);
    let own = back * fix.covariance.matrix * back.transpose();
    let mixed = stay * common * go.transpose();
    let sum = stay * known.covariance.matrix * stay.transpose() + go * own * go.transpose() + mixed + mixed.transpose();
    Some(ObjectPose {
        object_from_camera: known.object_from_camera.perturbed(&step).renormalized(),
        covariance: Covariance6::new((sum + sum.transpose()) * 0.5),
        sensitivities: stay * known.sensitivities + go * back * fix.sensitivities,
        consider_states: sum_of(known, &stay, fix, &(go * back)),
    })
}

/// The consider states of A ξ_known + B ξ_fix.
fn sum_of(known: &ObjectPose, a: &Matrix6<f64>, fix: &ObjectPose, b: &Matrix6<f64>) -> ConsiderStates {
    known.consider_states.carried(a).plus(&fix.consider_states.carried(b))
}

/// Number of Gauss–Newton iterations; two suffice for an innovation within the gate.
const ROUNDS: usize = 3;

/// The pose of minimum w₁ ‖log(T_known⁻¹ T)‖² + w₂ ‖log(T_fix⁻¹ T)‖², each norm in its own Mahalanobis metric.
///
/// `None` if a covariance is singular.
pub(super) fn joined(known: &ObjectPose, fix: &ObjectPose, weights: [f64; 2]) -> Option<ObjectPose> {
    let known_information = known.covariance.matrix.try_inverse()? * weights[0];
    let fix_information = fix.covariance.matrix.try_inverse()? * weights[1];
    let mut pose = known.object_from_camera;
    let mut information = known_information;
    let mut pulls = [Matrix6::zeros(); 2];
    for _ in 0..ROUNDS {
        let mut gradient = Vector6::zeros();
        information = Matrix6::zeros();
        let both = [(&known.object_from_camera, &known_information), (&fix.object_from_camera, &fix_information)];
        for ((from, weight), pull) in both.into_iter().zip(&mut pulls) {
            let residual = from.error_to(&pose);
            let jacobian = right_jacobian_inverse(&residual);
            gradient += jacobian.transpose() * weight * residual;
            information += jacobian.transpose() * weight * jacobian;
            *pull = jacobian.transpose() * weight;
        }
        pose = pose.perturbed(&-(information.cholesky()?.solve(&gradient))).renormalized();
    }
    let covariance = Covariance6::new(information.cholesky()?.inverse());
    // The gain of each input is its share of the information.
    let [stay, go] = pulls.map(|pull| covariance.matrix * pull);
    Some(ObjectPose {
        object_from_camera: pose,
        covariance,
        sensitivities: stay * known.sensitivities + go * fix.sensitivities,
        consider_states: sum_of(known, &stay, fix, &go),
    })
}

/// The covariance of J_r(r)⁻¹ η, with η the error in Exp(r) Exp(η) = Exp(r + J_r(r)⁻¹ η).
pub(super) fn carried_back(covariance: &Matrix6<f64>, r: &Vector6<f64>) -> Matrix6<f64> {
    let jacobian = right_jacobian_inverse(r);
    jacobian * covariance * jacobian.transpose()
}
