//! Solvers: the rigid motion that carries the measured points onto the model.

use seafix_component::{Registry, entry};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::Observations;

mod kabsch;
pub(crate) mod likelihood;
mod numerical;
mod spread;
#[cfg(test)]
mod tests;
mod triad;

pub use kabsch::Kabsch;
pub(crate) use kabsch::fit as least_squares;
pub use triad::{Choose, Triad};

/// Geometry that determines no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Degenerate {
    /// Fewer points than the solver needs.
    #[error("{found} points; the solver needs {needed}")]
    TooFew {
        /// How many there are.
        found: usize,
        /// How many it needs.
        needed: usize,
    },
    /// The points lie (nearly) on a line: the rotation about it is unknown.
    #[error(
        "the points are nearly collinear: their second extent is {ratio:.2e} of the first, at least {least:.2e} is needed"
    )]
    Collinear {
        /// Second singular value over the first.
        ratio: f64,
        /// The least accepted.
        least: f64,
    },
    /// A number is not finite.
    #[error("a coordinate is not finite")]
    NotFinite,
}

/// Computes the rigid motion that carries observed points onto model points.
pub trait Solver: Send + Sync + std::fmt::Debug {
    /// The least number of points it works with.
    fn minimum(&self) -> usize {
        3
    }

    /// Whether its pose claims the least sum of squared, unweighted residuals of all rigid motions.
    fn least_squares(&self) -> bool {
        false
    }

    /// The pose `object_from_camera`.
    ///
    /// # Errors
    /// [`Degenerate`]: the geometry determines no pose, with the number that failed.
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>;

    /// Which of the points the pose rests on, as ascending indices: all of them, unless the solver
    /// says otherwise. Empty where `solve` would refuse.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        (0..data.points.len()).collect()
    }

    /// First-order covariance of [`solve`](Self::solve) at its answer: Σ = Σ_i J_i Σ_i J_iᵀ over all
    /// measured and model points, J by central differences through the solver itself. Honest for
    /// any solver, whatever its weights.
    ///
    /// # Errors
    /// As `solve`.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        numerical::covariance(|moved| self.solve(moved), data, at)
    }
}

/// All solvers.
pub static SOLVERS: Registry<dyn Solver> = Registry::new("solver", &[entry!(Kabsch), entry!(Triad)]);
