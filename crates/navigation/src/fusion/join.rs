//! What all that join a fix with what was known have in common: the gate, and the poses between the two.

use nalgebra::{Matrix6, Vector6};
use seafix_geometry::{Covariance6, right_jacobian_inverse};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Contradiction;
use crate::{ConsiderStates, ObjectPose};

/// Whether a fix agrees with what was known: rᵀ S⁻¹ r ≤ χ²₆(`confidence`), r = log(T_known⁻¹ T_fix), S its covariance as
/// far as it is known what both have in common.
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

/// r = log(T_known⁻¹ T_fix) = ξ_known − F ξ_fix, F = J_r(r)⁻¹, and how it goes with the error of what was known.
struct Innovation {
    r: Vector6<f64>,
    /// F.
    back: Matrix6<f64>,
    /// X = E[ξ_known (F ξ_fix)ᵀ].
    common: Matrix6<f64>,
    /// S = Σ_known + F Σ_fix Fᵀ − X − Xᵀ.
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

/// The pose of least covariance between the two, and what its error shares with models and surveys:
///
/// K = (Σ_known − X) S⁻¹, ξ = (I − K) ξ_known + K F ξ_fix about T_known Exp(K r).
///
/// The covariance is that of this sum whatever K is (Joseph's form). `None` where S is singular.
pub(super) fn consider_states(known: &ObjectPose, fix: &ObjectPose) -> Option<ObjectPose> {
    let Innovation { r, back, common, covariance } = Innovation::of(known, fix);
    let gain = covariance.cholesky()?.solve(&(known.covariance.matrix - common).transpose()).transpose();
    let step = gain * r;
    // T_known Exp(ξ_known) = T_known Exp(step) Exp(ξ): ξ = J_r(step) (ξ_known − step).
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

/// What A ξ_known + B ξ_fix shares with models and surveys.
fn sum_of(known: &ObjectPose, a: &Matrix6<f64>, fix: &ObjectPose, b: &Matrix6<f64>) -> ConsiderStates {
    known.consider_states.carried(a).plus(&fix.consider_states.carried(b))
}

/// Two rounds settle it: an innovation within the gate is a few standard deviations.
const ROUNDS: usize = 3;

/// The pose with the least w₁ ‖log(T_known⁻¹ T)‖² + w₂ ‖log(T_fix⁻¹ T)‖², each in its own metric; `None` where a
/// covariance is singular.
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
    // Of each so much stays as it weighed.
    let [stay, go] = pulls.map(|pull| covariance.matrix * pull);
    Some(ObjectPose {
        object_from_camera: pose,
        covariance,
        sensitivities: stay * known.sensitivities + go * fix.sensitivities,
        consider_states: sum_of(known, &stay, fix, &go),
    })
}

/// The covariance of η in Exp(r) Exp(η) = Exp(r + J_r(r)⁻¹ η), as one of the sum.
pub(super) fn carried_back(covariance: &Matrix6<f64>, r: &Vector6<f64>) -> Matrix6<f64> {
    let jacobian = right_jacobian_inverse(r);
    jacobian * covariance * jacobian.transpose()
}
