//! Odometry errors that are correlated over many steps.

use nalgebra::{Matrix6, SMatrix, SVector, Vector4};
use seafix_geometry::{Camera, Covariance6, Transform};

use crate::odometry_trajectory::RelativeMotion;

/// The maximum number of correlated errors.
pub(crate) const CORRELATED: usize = 10;

/// Derivatives by, or cross-covariances with, the correlated errors: one column each.
pub(crate) type CorrelatedSensitivities = SMatrix<f64, 6, CORRELATED>;

/// The correlated part of an odometry step's error.
///
/// Independent errors of the steps make the position error grow with the square root of the path length. Other errors
/// persist: a scale error or a gyro bias is the same in every step, and the error of an extrapolation that precedes a
/// late reading is undone by the next step. Such errors m enter the error ξ of a step as
///
/// ξ = J m + w, m′ = D m + …,
///
/// with D diagonal and w independent noise of the step. A pose with error ξ₀ keeps the cross-covariance C = E\[ξ₀ mᵀ\]
/// beside its covariance Σ, as a Schmidt–Kalman filter does for states that it considers and does not estimate:
///
/// Σ′ = A Σ Aᵀ + A C Jᵀ + J Cᵀ Aᵀ + Σ_step, C′ = A C D + E\[ξ m′ᵀ\], A = Ad(later_from_earlier).
///
/// Source: Schmidt, *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedError {
    /// The derivative J of the step's error by m.
    pub(crate) by: CorrelatedSensitivities,
    /// The diagonal of the transition matrix D.
    pub(crate) keep: SVector<f64, CORRELATED>,
    /// The cross-covariance E\[ξ m′ᵀ\].
    pub(crate) with: CorrelatedSensitivities,
    /// The covariance E\[m mᵀ\] before the step.
    pub(crate) before: CorrelatedCovariance,
    /// The covariance E\[m′ m′ᵀ\] after the step.
    pub(crate) after: CorrelatedCovariance,
}

/// The covariance of the correlated errors: four independent variances, then the 6×6 block `held`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CorrelatedCovariance {
    pub(crate) independent: Vector4<f64>,
    pub(crate) held: Matrix6<f64>,
}

impl CorrelatedCovariance {
    /// The covariance as one matrix.
    pub(crate) fn matrix(&self) -> SMatrix<f64, CORRELATED, CORRELATED> {
        let mut all = SMatrix::<f64, CORRELATED, CORRELATED>::zeros();
        all.fixed_view_mut::<4, 4>(0, 0).set_diagonal(&self.independent);
        all.fixed_view_mut::<6, 6>(4, 4).copy_from(&self.held);
        all
    }
}

/// The covariance Σ′ and cross-covariance C′ of a pose after a further step.
pub(crate) fn carried(
    covariance: &Matrix6<f64>,
    sensitivities: &CorrelatedSensitivities,
    step: &RelativeMotion,
) -> (Matrix6<f64>, CorrelatedSensitivities) {
    let adjoint = later_from_earlier(&step.motion);
    let mut covariance = adjoint * covariance * adjoint.transpose() + step.covariance.matrix;
    let Some(CorrelatedError { by, keep, with, .. }) = &step.correlated else {
        return (covariance, CorrelatedSensitivities::zeros());
    };
    let carried = adjoint * sensitivities;
    let common = carried * by.transpose();
    covariance += common + common.transpose();
    (covariance, scaled(&carried, keep) + with)
}

/// The adjoint A of `later_from_earlier`.
fn later_from_earlier(motion: &Transform<Camera, Camera>) -> Matrix6<f64> {
    motion.inverse().adjoint()
}

fn scaled(sensitivities: &CorrelatedSensitivities, by: &SVector<f64, CORRELATED>) -> CorrelatedSensitivities {
    CorrelatedSensitivities::from_fn(|row, k| sensitivities[(row, k)] * by[k])
}

impl RelativeMotion {
    /// The composition of this motion with the motion `next`.
    ///
    /// Its J is A J + J_next D, its D the product of both. Independent errors stay independent; correlated errors begin
    /// with the first step that has them.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let sensitivities = self.correlated.map_or_else(CorrelatedSensitivities::zeros, |correlated| correlated.with);
        let (covariance, with) = carried(&self.covariance.matrix, &sensitivities, next);
        let correlated = next.correlated.map(|further| match &self.correlated {
            None => CorrelatedError { with, ..further },
            Some(first) => CorrelatedError {
                by: later_from_earlier(&next.motion) * first.by + scaled(&further.by, &first.keep),
                keep: first.keep.component_mul(&further.keep),
                with,
                before: first.before,
                after: further.after,
            },
        });
        let motion = (self.motion * next.motion).renormalized();
        Self { motion, covariance: Covariance6::new(covariance), correlated }
    }
}
