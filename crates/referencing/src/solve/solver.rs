//! The trait of the solvers.

use nalgebra::SMatrix;
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::{
    observations::Observations,
    solve::{covariance::numerical, degeneracy::Degenerate, likelihood::initial_poses::AlternativePose},
};

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
/// let data = Observations { points: points.to_vec(), edges: Vec::new(), rig: None };
/// let pose = MeanTranslation.solve(&data)?;
/// assert!((pose.translation() - Vector3::new(0.0, 0.0, -3.0)).norm() < 1e-12);
///
/// // The mean of four points has half of their standard deviation along each of the three axes.
/// let sigma = MeanTranslation.covariance(&data, &pose)?.position_rms();
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

    /// Whether the solver uses edges; others solve for the points alone.
    fn takes_edges(&self) -> bool {
        false
    }

    /// Whether the pose minimises the sum of squared, unweighted residuals over all rigid motions.
    fn least_squares(&self) -> bool {
        false
    }

    /// Whether the answer is exact to rounding, so that equivalent inputs give equal answers.
    ///
    /// An optimiser without derivatives stops 1e-4 standard deviations from the minimum.
    fn to_rounding(&self) -> bool {
        true
    }

    /// The pose `object_from_camera`.
    ///
    /// # Errors
    ///
    /// [`Degenerate`]: the geometry determines no pose; the failed test is stated with its number.
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>;

    /// The pose near a known one; the pose of [`solve`](Self::solve) by default.
    ///
    /// # Errors
    ///
    /// As `solve`.
    fn solve_near(
        &self,
        data: &Observations<'_>,
        near: &Transform<Object, Camera>,
    ) -> Result<Transform<Object, Camera>, Degenerate> {
        let _ = near;
        self.solve(data)
    }

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
    /// Let `max` be the quantile of χ²₁ at the confidence c, and let there be two minima at a distance d. The
    /// solver then answers with the wrong one and omits the right one with a probability of at most (1 − c)/2, whatever
    /// d is: the difference of their χ² is normal with mean d² and variance 4d², and Q((d² + max) / 2d) is
    /// largest at d² = `max`.
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
        numerical::covariance(|moved| self.solve(moved), data, at)
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
        numerical::model_errors(|moved| self.solve(moved), data, at)
    }
}
