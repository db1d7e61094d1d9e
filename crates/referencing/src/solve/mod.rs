//! Solvers: the rigid motion that maps measured points onto model points.

use nalgebra::SMatrix;
use seafix_component::{Registry, entry};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::Observations;

mod closed_form;
mod covariance;
mod degeneracy;
mod fast_local_matrix;
mod gnc_tls;
mod horn;
mod irls;
mod kabsch;
mod l_bfgs;
pub(crate) mod likelihood;
mod mahalanobis;
mod nelder_mead;
mod optimiser;
mod p3p_stereo;
mod stereo_reprojection;
#[cfg(test)]
mod tests;
mod triad;
mod umeyama;
mod weighted_kabsch;

pub(crate) use closed_form::fit as least_squares;
pub(crate) use degeneracy::{ON_A_LINE, second_ratio};
pub(crate) use gnc_tls::GncTls;
pub use kabsch::Kabsch;
pub use likelihood::scale_error::ScaleError;
pub(crate) use likelihood::{
    descent::Term,
    normal::{inverse, rounding},
    pixel_terms::{PixelTerms, TermTarget as PixelTarget},
};
pub use mahalanobis::Mahalanobis;
pub use stereo_reprojection::StereoReprojection;
pub use triad::{Choose, Triad};

/// Geometry that determines no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Degenerate {
    /// Fewer points than the solver needs.
    #[error("too few points: {found} found, the solver needs {needed}")]
    TooFew {
        /// The number of points.
        found: usize,
        /// The number that the solver needs.
        needed: usize,
    },
    /// The points are (nearly) collinear, so the rotation about their line is undetermined.
    #[error("nearly collinear points: their second extent is {ratio:.2e} of the first, at least {min:.2e} is needed")]
    Collinear {
        /// The ratio of second to first singular value.
        ratio: f64,
        /// The smallest accepted ratio.
        min: f64,
    },
    /// A measured point lies behind the left camera.
    #[error("point behind the camera: point {index} has a depth of {depth:.3} m; check the triangulation")]
    Behind {
        /// The index of the point.
        index: usize,
        /// The depth (m), zero or less.
        depth: f64,
    },
    /// All points are too far away for the baseline.
    #[error(
        "points too far away for the baseline: the best distance has a relative error of {fraction:.2}, \
         at most {max:.2} is accepted"
    )]
    Far {
        /// The smallest relative standard deviation of a distance.
        fraction: f64,
        /// The largest accepted value.
        max: f64,
    },
    /// The solver needs pixels and a rig, and at least one is missing.
    #[error("no pixels or no rig: the solver needs both; use `mahalanobis` for points alone")]
    NoPixels,
    /// Measured points and model differ in scale.
    #[error(
        "wrong scale: the model is {scale:.4} times as large as the measured points, a deviation of {max} is \
        accepted"
    )]
    Scale {
        /// The scale of the best similarity.
        scale: f64,
        /// The largest accepted deviation from one.
        max: f64,
    },
    /// The normal equations are singular: a motion changes no measurement.
    #[error(
        "undetermined motion: the smallest eigenvalue of the information, scaled to a unit diagonal, is \
         {fraction:.1e}, \
         more than the rounding error of {min:.1e} is needed"
    )]
    Singular {
        /// The smallest eigenvalue of the scaled information.
        fraction: f64,
        /// The smallest eigenvalue above rounding.
        min: f64,
    },
    /// A coordinate is not finite.
    #[error("invalid point: a coordinate is not finite")]
    NotFinite,
    /// The covariance of a point is not finite or not invertible.
    #[error("invalid noise of point {index}: its covariance must be finite and positive definite")]
    Noise {
        /// The index of the point.
        index: usize,
    },
    /// A pose of the iteration puts a point out of a camera's view.
    #[error(
        "hidden point: a pose of the iteration puts point {index} at a depth of {depth:.3} m, out of a camera's \
        view"
    )]
    Hidden {
        /// The index of the point.
        index: usize,
        /// The depth in the left camera (m).
        depth: f64,
    },
    /// Too few resampled problems have a solution to estimate a covariance.
    #[error("no covariance: only {answered} of {sampled} resampled problems have a solution, nine of ten are needed")]
    Scattered {
        /// The number of resampled problems with a solution.
        answered: usize,
        /// The number of resampled problems.
        sampled: usize,
    },
    /// An iteration ended before its minimum.
    #[error("no convergence: after {steps} steps the minimum is {off:.2e} standard deviations away, {max} is accepted")]
    Unconverged {
        /// The number of steps.
        steps: u64,
        /// The distance of the minimum (standard deviations of the pose).
        off: f64,
        /// The largest accepted distance.
        max: f64,
    },
}

/// Largest distance (standard deviations of the pose) from the minimum at the end of an iteration.
///
/// It adds at most 1 in 20 000 to the error.
const CONVERGED: f64 = 0.01;

/// Rejects a pose farther from its minimum than [`CONVERGED`]; a NaN is rejected as well.
pub(crate) fn converged(steps: u64, off: f64) -> Result<(), Degenerate> {
    if off <= CONVERGED { Ok(()) } else { Err(Degenerate::Unconverged { steps, off, max: CONVERGED }) }
}

/// Rejects geometry without a pose: fewer than three points, numbers that are not finite, collinear points and, with a
/// rig, points behind the camera or too far away.
pub(crate) fn wide_enough(data: &Observations<'_>) -> Result<(), Degenerate> {
    degeneracy::check(data, 3, 1e-3)
}

/// An alternative pose that explains the same points nearly as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternativePose {
    /// The pose.
    pub pose: Transform<Object, Camera>,
    /// The excess of its χ² over the answer's; negative if its χ² is smaller.
    pub worse: f64,
}

/// A solver: the rigid motion that maps measured points onto model points.
///
/// [`covariance`](Self::covariance) and [`model_errors`](Self::model_errors) have default implementations by numerical
/// derivatives, so [`solve`](Self::solve) suffices.
///
/// ```
/// use nalgebra::{UnitQuaternion, Vector3};
/// use seafix_geometry::{Camera, Object, Point, Transform, UncertainPoint};
/// use seafix_referencing::{Degenerate, Observation, Observations, Solver};
///
/// /// The mean translation, for a camera with the object's attitude.
/// #[derive(Debug)]
/// struct MeanTranslation;
///
/// impl Solver for MeanTranslation {
///     fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
///         if data.points.len() < self.minimum() {
///             return Err(Degenerate::TooFew { found: data.points.len(), needed: self.minimum() });
///         }
///         let sum: Vector3<f64> = data.points.iter().map(|point| point.model.coords - point.measured.at.coords).sum();
///         Ok(Transform::new(UnitQuaternion::identity(), sum / data.points.len() as f64))
///     }
/// }
///
/// // Four points, measured 3 m in front of the camera with a standard deviation of 10 mm.
/// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|at: [f64; 3]| Observation {
///     measured: UncertainPoint::isotropic(Point::new(at[0], at[1], at[2] + 3.0), 0.01),
///     pixels: None,
///     model: Point::from(at),
///     model_sigma: 0.0,
/// });
/// let data = Observations { points: points.to_vec(), rig: None };
/// let pose = MeanTranslation.solve(&data)?;
/// assert!((pose.translation() - Vector3::new(0.0, 0.0, -3.0)).norm() < 1e-12);
///
/// // The mean of four points has half of their standard deviation along each of the three axes.
/// let sigma = MeanTranslation.covariance(&data, &pose)?.position_sigma();
/// assert!((sigma - 0.005 * 3f64.sqrt()).abs() < 1e-6);
/// # Ok::<(), Degenerate>(())
/// ```
pub trait Solver: Send + Sync + std::fmt::Debug {
    /// The minimum number of points.
    fn minimum(&self) -> usize {
        3
    }

    /// Whether the solver needs the pixels of both images; it rejects points without them.
    fn needs_pixels(&self) -> bool {
        false
    }

    /// Whether the pose minimises the sum of squared, unweighted residuals over all rigid motions.
    fn least_squares(&self) -> bool {
        false
    }

    /// Whether the answer is exact to rounding, so that equivalent inputs give equal answers.
    ///
    /// A general-purpose optimiser that evaluates costs only ends 1e-4 standard deviations from the minimum.
    fn to_rounding(&self) -> bool {
        true
    }

    /// The pose `object_from_camera`.
    ///
    /// # Errors
    ///
    /// [`Degenerate`]: the geometry determines no pose; the failed test is stated with its number.
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>;

    /// The scale s of the model relative to the measured points: min Σ ‖P_k − s C_k H‖².
    ///
    /// It is a diagnostic; a fix is rigid and does not use it. `None` for solvers that do not estimate it, and for
    /// geometry that `solve` rejects.
    fn scale(&self, data: &Observations<'_>) -> Option<f64> {
        let _ = data;
        None
    }

    /// The indices of the points that determine the pose, ascending; all points by default.
    ///
    /// Empty if `solve` rejects the geometry.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        (0..data.points.len()).collect()
    }

    /// Other local minima with a χ² of at most `max` above that of the answer `at`.
    ///
    /// Minima within the covariance of the answer are excluded. Others occur with few points whose extent is small
    /// relative to their distance. A solver with a single minimum returns none.
    ///
    /// With `max` the quantile of χ²₁ at a confidence, the probability of answering with the wrong one of two minima
    /// alone is at most half of one minus the confidence, for every distance d of the minima: the difference of their
    /// χ² is normal with mean d² and variance 4d², and Q((d² + max) / 2d) is largest at d² = `max`.
    fn alternatives(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, max: f64) -> Vec<AlternativePose> {
        let _ = (data, at, max);
        Vec::new()
    }

    /// The first-order covariance of [`solve`](Self::solve) at its answer `at`.
    ///
    /// Σ = Σ_i J_i Σ_i J_iᵀ over all measured and model points, with J by central differences through the solver
    /// itself. It is consistent for any solver, whatever its weights.
    ///
    /// # Errors
    ///
    /// As `solve`.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        covariance::numerical::covariance(|moved| self.solve(moved), data, at)
    }

    /// The contribution of model errors to the [`covariance`](Self::covariance): H = σ_model ∂ξ/∂P for each point.
    ///
    /// H is the pose error for one standard deviation of each of the point's coordinates, by central differences
    /// through the solver. Σ H Hᵀ is common to every pose from this model; the rest of the covariance is independent
    /// between images.
    ///
    /// # Errors
    ///
    /// As `solve`.
    fn model_errors(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        covariance::numerical::model_errors(|moved| self.solve(moved), data, at)
    }
}

/// The registry of solvers.
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
