//! Errors that last from step to step.

use nalgebra::{Matrix6, SMatrix, SVector, Vector4};
use seafix_geometry::{Camera, Covariance6, Transform};

use crate::Local;

/// So many numbers can last.
pub(crate) const LASTING: usize = 10;

/// A step's or a pose's share in errors that last: a column each.
pub(crate) type Shares = SMatrix<f64, 6, LASTING>;

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
pub struct Lasting {
    /// J.
    pub(crate) by: Shares,
    /// The diagonal of D.
    pub(crate) keep: SVector<f64, LASTING>,
    /// E\[ξ m′ᵀ\].
    pub(crate) with: Shares,
    /// E\[m mᵀ\].
    pub(crate) before: Spread,
    /// E\[m′ m′ᵀ\].
    pub(crate) after: Spread,
}

/// How far errors that last are from zero: the first four independent of all others, the rest with the covariance `held`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    pub(crate) independent: Vector4<f64>,
    pub(crate) held: Matrix6<f64>,
}

impl Spread {
    /// The covariance of all.
    pub(crate) fn matrix(&self) -> SMatrix<f64, LASTING, LASTING> {
        let mut all = SMatrix::<f64, LASTING, LASTING>::zeros();
        all.fixed_view_mut::<4, 4>(0, 0).set_diagonal(&self.independent);
        all.fixed_view_mut::<6, 6>(4, 4).copy_from(&self.held);
        all
    }
}

/// Carries Σ and C of a motion along a further step.
pub(crate) fn carried(covariance: &Matrix6<f64>, shares: &Shares, step: &Local) -> (Matrix6<f64>, Shares) {
    let adjoint = later_from_earlier(&step.motion);
    let mut covariance = adjoint * covariance * adjoint.transpose() + step.covariance.matrix;
    let Some(Lasting { by, keep, with, .. }) = &step.lasting else { return (covariance, Shares::zeros()) };
    let carried = adjoint * shares;
    let common = carried * by.transpose();
    covariance += common + common.transpose();
    (covariance, scaled(&carried, keep) + with)
}

/// A.
fn later_from_earlier(motion: &Transform<Camera, Camera>) -> Matrix6<f64> {
    motion.inverse().adjoint()
}

fn scaled(shares: &Shares, by: &SVector<f64, LASTING>) -> Shares {
    Shares::from_fn(|row, k| shares[(row, k)] * by[k])
}

impl Local {
    /// This motion and then `next`, as one motion: its J is A J + J_next D, its D the product. What is independent of all
    /// else stays so; errors that last begin with the first step that has them.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let shares = self.lasting.map_or_else(Shares::zeros, |lasting| lasting.with);
        let (covariance, with) = carried(&self.covariance.matrix, &shares, next);
        let lasting = next.lasting.map(|further| match &self.lasting {
            None => Lasting { with, ..further },
            Some(first) => Lasting {
                by: later_from_earlier(&next.motion) * first.by + scaled(&further.by, &first.keep),
                keep: first.keep.component_mul(&further.keep),
                with,
                before: first.before,
                after: further.after,
            },
        });
        let motion = (self.motion * next.motion).renormalized();
        Self { motion, covariance: Covariance6::new(covariance), lasting }
    }
}
