//! Errors that last from step to step.

use nalgebra::{Matrix6, SMatrix, SVector, Vector4};
use seafix_geometry::{Camera, Covariance6, Transform};

use crate::RelativeMotion;

/// So many numbers can last.
pub(crate) const CORRELATED: usize = 10;

/// A step's or a pose's share in errors that last: a column each.
pub(crate) type CorrelatedSensitivities = SMatrix<f64, 6, CORRELATED>;

/// What the error of a step has in common with those of the steps around it.
///
/// Six numbers ξ a step that are independent of all others make an error that grows with the root of the way. A scale or a
/// bias errs alike in every step, and what a pose was guessed to be until a late reading came is undone by the next. Such
/// errors m enter as
///
/// ξ = J m + w, m′ = D m + …,
///
/// D diagonal, w the step's own. A pose whose error is ξ₀ keeps C = E\[ξ₀ mᵀ\] beside its covariance Σ, as a filter keeps
/// what it considers but does not estimate:
///
/// Σ′ = A Σ Aᵀ + A C Jᵀ + J Cᵀ Aᵀ + Σ_step, C′ = A C D + E\[ξ m′ᵀ\], A = Ad(later_from_earlier).
///
/// Source: Schmidt, *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedError {
    /// J.
    pub(crate) by: CorrelatedSensitivities,
    /// The diagonal of D.
    pub(crate) keep: SVector<f64, CORRELATED>,
    /// E\[ξ m′ᵀ\].
    pub(crate) with: CorrelatedSensitivities,
    /// E\[m mᵀ\].
    pub(crate) before: CorrelatedCovariance,
    /// E\[m′ m′ᵀ\].
    pub(crate) after: CorrelatedCovariance,
}

/// How far errors that last are from zero: the first four independent of all others, the rest with the covariance `held`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CorrelatedCovariance {
    pub(crate) independent: Vector4<f64>,
    pub(crate) held: Matrix6<f64>,
}

impl CorrelatedCovariance {
    /// The covariance of all.
    pub(crate) fn matrix(&self) -> SMatrix<f64, CORRELATED, CORRELATED> {
        let mut all = SMatrix::<f64, CORRELATED, CORRELATED>::zeros();
        all.fixed_view_mut::<4, 4>(0, 0).set_diagonal(&self.independent);
        all.fixed_view_mut::<6, 6>(4, 4).copy_from(&self.held);
        all
    }
}

/// Carries Σ and C of a motion along a further step.
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

/// A.
fn later_from_earlier(motion: &Transform<Camera, Camera>) -> Matrix6<f64> {
    motion.inverse().adjoint()
}

fn scaled(sensitivities: &CorrelatedSensitivities, by: &SVector<f64, CORRELATED>) -> CorrelatedSensitivities {
    CorrelatedSensitivities::from_fn(|row, k| sensitivities[(row, k)] * by[k])
}

impl RelativeMotion {
    /// This motion and then `next`, as one motion: its J is A J + J_next D, its D the product. What is independent of all
    /// else stays so; errors that last begin with the first step that has them.
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
