//! The integrity of a fix.

use pyo3::prelude::*;
use seafix::referencing;

/// The integrity of a fix: residual test, solution separation, protection levels, scale error and depth error.
///
/// Levels are those of Blanch and others, *Baseline advanced RAIM user algorithm*, 2015.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Integrity(pub(crate) referencing::Integrity);

#[pymethods]
impl Integrity {
    /// str: the grade of redundancy by the number of points and edges: ``unmonitored``, ``detectable`` or ``excludable``.
    #[getter]
    fn redundancy(&self) -> &'static str {
        self.0.redundancy.name()
    }

    /// float: χ² of the residuals at the maximum-likelihood pose.
    #[getter]
    fn chi2(&self) -> f64 {
        self.0.chi2
    }

    /// int: the degrees of freedom of χ², 3k + 4m − 6 for k points and m edges.
    #[getter]
    fn dof(&self) -> usize {
        self.0.dof
    }

    /// float: the limit of χ², which a correct set exceeds with probability one minus the confidence.
    #[getter]
    fn chi2_limit(&self) -> f64 {
        self.0.chi2_limit
    }

    /// float or None: the largest shift of the position (m) when one point is excluded; None if one is indispensable.
    #[getter]
    fn solution_separation(&self) -> Option<f64> {
        self.0.solution_separation
    }

    /// float or None: the largest shift of the position (m) when two points are excluded; None if two are indispensable.
    #[getter]
    fn solution_separation_two(&self) -> Option<f64> {
        self.0.solution_separation_two
    }

    /// float or None: the protection level of the position (m), exceeded with the probability `risk` of the acceptance.
    ///
    /// None without redundancy, or if the probability of a wrong pose exceeds the risk.
    #[getter]
    fn position_level(&self) -> Option<f64> {
        self.0.protection.map(|level| level.position)
    }

    /// float or None: the protection level of the attitude (rad), like `position_level`.
    #[getter]
    fn attitude_level(&self) -> Option<f64> {
        self.0.protection.map(|level| level.attitude)
    }

    /// float or None: measured distances are longer than the model's by this fraction; None with three points.
    #[getter]
    fn scale_error(&self) -> Option<f64> {
        self.0.scale_error.map(|error| error.value)
    }

    /// float or None: the standard deviation of `scale_error`.
    #[getter]
    fn scale_error_sigma(&self) -> Option<f64> {
        self.0.scale_error.map(|error| error.sigma)
    }

    /// float or None: measured distances along the optical axis are longer than the model's by this fraction.
    ///
    /// A focal length f of both cameras instead of f₀ gives f/f₀ − 1. None with three points, or if the points do not
    /// determine it, as those of a plane seen face-on.
    #[getter]
    fn depth_error(&self) -> Option<f64> {
        self.0.depth_error.map(|error| error.value)
    }

    /// float or None: the standard deviation of `depth_error`.
    #[getter]
    fn depth_error_sigma(&self) -> Option<f64> {
        self.0.depth_error.map(|error| error.sigma)
    }

    fn __repr__(&self) -> String {
        let level = self.position_level().map_or_else(|| "none".to_owned(), |level| format!("{level:.3} m"));
        format!("Integrity(χ² {:.1} of {} degrees of freedom, position level {level})", self.0.chi2, self.0.dof)
    }
}
