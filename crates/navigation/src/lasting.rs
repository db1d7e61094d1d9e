//! Errors that last from step to step.

use nalgebra::{SMatrix, SVector};

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
}
