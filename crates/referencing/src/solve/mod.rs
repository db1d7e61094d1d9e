//! Solvers: the rigid motion that carries the measured points onto the model.

use nalgebra::SMatrix;
use seafix_component::{Registry, entry};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::Observations;

mod degeneracy;
mod descent;
mod fast_local_matrix;
mod gnc_tls;
mod horn;
mod initial_poses;
mod irls;
mod kabsch;
mod l_bfgs;
pub(crate) mod leave_out;
pub(crate) mod likelihood;
mod mahalanobis;
mod nelder_mead;
mod normal;
mod numerical;
mod p3p;
mod p3p_stereo;
mod pixel_cost;
mod pixel_terms;
mod profile;
mod resampled;
mod roots;
mod sandwich;
pub(crate) mod scale_error;
mod sigma_directions;
mod stereo_cameras;
mod stereo_reprojection;
#[cfg(test)]
mod tests;
mod triad;
mod umeyama;
mod weighted_kabsch;
mod whitened;

pub(crate) use degeneracy::{ON_A_LINE, second_ratio};
pub(crate) use descent::Term;
pub(crate) use gnc_tls::GncTls;
pub use kabsch::Kabsch;
pub(crate) use kabsch::fit as least_squares;
pub use mahalanobis::Mahalanobis;
pub(crate) use normal::{inverse, rounding};
pub(crate) use pixel_terms::{PixelTerms, TermTarget as PixelTarget};
pub use scale_error::ScaleError;
pub use stereo_reprojection::StereoReprojection;
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
        "the points are nearly collinear: their second extent is {ratio:.2e} of the first, at least {min:.2e} is needed"
    )]
    Collinear {
        /// Second singular value over the first.
        ratio: f64,
        /// The least accepted.
        min: f64,
    },
    /// A measured point lies behind the left camera.
    #[error("point {index} was measured {depth:.3} m before the left camera; a camera sees what is in front of it")]
    Behind {
        /// Its place among the points.
        index: usize,
        /// Its depth (m), zero or less.
        depth: f64,
    },
    /// All points are so far away that the two cameras see them from one place.
    #[error(
        "even the best measured distance is uncertain by {fraction:.2} of itself, at most {max:.2} is accepted: the \
         points are too far away for the baseline"
    )]
    Far {
        /// Least standard deviation of a distance over the distance.
        fraction: f64,
        /// The most accepted.
        max: f64,
    },
    /// The solver looks at pixels, and there are none, or no rig.
    #[error("the points have no pixels or there is no rig; `mahalanobis` takes points alone")]
    NoPixels,
    /// The measured points have not the size of the model's.
    #[error("the model is {scale:.4} times as large as what was measured; {max} off one is accepted")]
    Scale {
        /// The scale of the best similarity.
        scale: f64,
        /// Largest accepted distance from one.
        max: f64,
    },
    /// The normal equations have no solution: some motion changes nothing that was measured.
    #[error(
        "the points leave a motion undetermined: their information, scaled to ones on its diagonal, has the least \
         eigenvalue {fraction:.1e}; more than rounding, {min:.1e}, is needed"
    )]
    Singular {
        /// The least eigenvalue of the scaled information.
        fraction: f64,
        /// The least that is told from none.
        min: f64,
    },
    /// A number is not finite.
    #[error("a coordinate is not finite")]
    NotFinite,
    /// The stated noise of a point is none: not finite, or without an inverse.
    #[error("the noise of point {index} is no covariance: it must be finite and positive definite")]
    Noise {
        /// Its place among the points.
        index: usize,
    },
    /// A pose on the way to the answer puts a point where a camera that saw it cannot.
    #[error("a pose that was tried puts point {index} at a depth of {depth:.3} m, where a camera that saw it cannot")]
    Hidden {
        /// Its place among the points.
        index: usize,
        /// Its depth before the left camera (m).
        depth: f64,
    },
    /// Other noise of the same size leaves too few answers to tell how they scatter.
    #[error(
        "of {sampled} draws of other noise only {answered} have an answer; nine of ten are needed for a covariance"
    )]
    Scattered {
        /// Draws with an answer.
        answered: usize,
        /// All draws.
        sampled: usize,
    },
    /// An iteration ended before it was at its minimum.
    #[error("after {steps} steps the minimum is still {off:.2e} standard deviations away; at most {max} is accepted")]
    Unconverged {
        /// Steps that were taken.
        steps: u64,
        /// How far the minimum still is (standard deviations of the pose).
        off: f64,
        /// The most accepted.
        max: f64,
    },
}

/// The farthest from its minimum (standard deviations of the pose) that an iteration may end: an error that is added
/// to the noise's own makes it one in twenty thousand larger.
const CONVERGED: f64 = 0.01;

/// Refuses a pose that is farther from its minimum than [`CONVERGED`], and a distance that is no number.
pub(crate) fn converged(steps: u64, off: f64) -> Result<(), Degenerate> {
    if off <= CONVERGED { Ok(()) } else { Err(Degenerate::Unconverged { steps, off, max: CONVERGED }) }
}

/// Refuses what determines no pose: fewer than three points, numbers that are not finite, points on a line and, seen by a
/// rig, behind the camera or too far away.
pub(crate) fn wide_enough(data: &Observations<'_>) -> Result<(), Degenerate> {
    degeneracy::check(data, 3, 1e-3)
}

/// Another pose that explains the same points nearly as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternativePose {
    /// The pose.
    pub pose: Transform<Object, Camera>,
    /// By how much its χ² is larger; less than nought where it is smaller.
    pub worse: f64,
}

/// Computes the rigid motion that carries observed points onto model points.
pub trait Solver: Send + Sync + std::fmt::Debug {
    /// The least number of points it works with.
    fn minimum(&self) -> usize {
        3
    }

    /// Whether it looks at the pixels of both images, and refuses points without them.
    fn needs_pixels(&self) -> bool {
        false
    }

    /// Whether its pose claims the least sum of squared, unweighted residuals of all rigid motions.
    fn least_squares(&self) -> bool {
        false
    }

    /// Whether it answers to rounding error, so that the same problem written otherwise has the same answer. A
    /// general-purpose optimiser that looks at costs alone ends a ten-thousandth of a standard deviation off.
    fn to_rounding(&self) -> bool {
        true
    }

    /// The pose `object_from_camera`.
    ///
    /// # Errors
    /// [`Degenerate`]: the geometry determines no pose, with the number that failed.
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>;

    /// The scale s of the model against the measured points, of least Σ ‖P_k − s C_k H‖²: a diagnostic of a solver that finds
    /// it. A fix is rigid and does not use it. `None` of other solvers, and where `solve` refuses the geometry.
    fn scale(&self, data: &Observations<'_>) -> Option<f64> {
        let _ = data;
        None
    }

    /// Which of the points the pose rests on, as ascending indices: all of them, unless the solver
    /// says otherwise. Empty where `solve` would refuse.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        (0..data.points.len()).collect()
    }

    /// Other poses that are as likely as [`solve`](Self::solve)'s answer `at`, but for no more than `max` of χ², and that its
    /// covariance does not contain: minima in other valleys of the likelihood, as few points that are small for their distance
    /// have them. None of a solver whose cost has one minimum.
    ///
    /// With `max` the quantile of χ²₁ at a confidence, that of two valleys the wrong one is answered alone has no more than
    /// half the probability that the confidence leaves, whatever the distance d of the valleys: the difference of their χ² is
    /// normal with mean d² and variance 4d², and Q((d² + most) / 2d) is greatest where d² is `max`.
    fn alternatives(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, max: f64) -> Vec<AlternativePose> {
        let _ = (data, at, max);
        Vec::new()
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

    /// What the model's errors have in [`covariance`](Self::covariance): for each point H = σ_model ∂ξ/∂P, the error of the
    /// pose a standard deviation of that point's three coordinates, by central differences through the solver itself.
    /// Σ H Hᵀ is common to every pose from this model; the rest is drawn anew with each image.
    ///
    /// # Errors
    /// As `solve`.
    fn model_errors(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        numerical::model_errors(|moved| self.solve(moved), data, at)
    }
}

/// All solvers.
pub static SOLVERS: Registry<dyn Solver> = Registry::new(
    "solver",
    &[
        entry!(fast_local_matrix::FastLocalMatrix),
        entry!(gnc_tls::GncTls),
        entry!(horn::Horn),
        entry!(irls::Irls),
        entry!(Kabsch),
        entry!(l_bfgs::LBfgs),
        entry!(Mahalanobis),
        entry!(nelder_mead::NelderMead),
        entry!(p3p_stereo::P3pStereo),
        entry!(StereoReprojection),
        entry!(Triad),
        entry!(umeyama::Umeyama),
        entry!(weighted_kabsch::WeightedKabsch),
    ],
);
