//! Prior poses.

use numpy::PyArray2;
use pyo3::prelude::*;
use seafix::{
    PosePrior as LibraryPrior,
    geometry::{Camera, Covariance6, Object, Transform},
    referencing::{Prior, PriorBound},
};

use crate::{
    array::{array4, array6, matrix, motion},
    invalid::invalid,
};

/// A prior pose with Gaussian uncertainty.
///
/// Parameters
/// ----------
/// T : array_like, shape (4, 4)
///     The prior pose of the left camera: ``object_from_camera`` for :func:`solve`, ``world_from_camera`` for a
///     :class:`Localizer`. ``p_object = T @ p_camera``, in metres.
/// position_sigma : float, optional
///     Standard deviation of the position along each camera axis (m).
/// attitude_sigma : float, optional
///     Standard deviation of the attitude about each camera axis (rad).
/// covariance : array_like, shape (6, 6), optional
///     Covariance of ξ = (φ, ρ) in ``T_true = T @ Exp(ξ)``, rotation (rad) first, along the camera axes; in place of
///     the two standard deviations.
///
/// Raises
/// ------
/// ValueError
///     `T` is not a rigid motion, or the uncertainty is missing or invalid.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct PosePrior {
    pose: Transform<Object, Camera>,
    covariance: Covariance6<Object, Camera>,
}

#[pymethods]
impl PosePrior {
    #[new]
    #[pyo3(signature = (T, position_sigma=None, attitude_sigma=None, *, covariance=None))]
    #[expect(non_snake_case, reason = "a transform is a capital letter in the field's papers")]
    fn new(
        py: Python<'_>,
        T: &Bound<'_, PyAny>,
        position_sigma: Option<f64>,
        attitude_sigma: Option<f64>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let pose = motion(T, "T")?;
        let sigma = |name: &str, value: f64| {
            if value >= 0.0 && value.is_finite() {
                return Ok(value);
            }
            Err(invalid(py, name, format!("`{name}` is {value}"), "give a finite number, zero or more"))
        };
        let covariance = match (position_sigma, attitude_sigma, covariance) {
            (Some(position), Some(attitude), None) => {
                Covariance6::isotropic(sigma("attitude_sigma", attitude)?, sigma("position_sigma", position)?)
            }
            (None, None, Some(given)) => {
                let given = matrix::<6>(given, "covariance")?;
                let bad = !given.iter().all(|x| x.is_finite())
                    || (given - given.transpose()).amax() > 1e-9 * given.amax()
                    || given.symmetric_eigenvalues().min() < -1e-9 * given.amax();
                if bad {
                    let what = "`covariance` is not symmetric and positive semidefinite";
                    return Err(invalid(py, "covariance", what, "give variances of (φ, ρ) in rad² and m²"));
                }
                Covariance6::new(given)
            }
            _ => {
                let remedy = "give `position_sigma` (m) and `attitude_sigma` (rad), or `covariance` alone";
                return Err(invalid(py, "position_sigma", "the uncertainty of the prior is not stated", remedy));
            }
        };
        Ok(Self { pose, covariance })
    }

    /// ndarray, shape (4, 4): the prior pose.
    #[getter(T)]
    fn pose<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array4(py, &self.pose.matrix())
    }

    /// ndarray, shape (6, 6): the covariance of ξ = (φ, ρ), in rad² and m².
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array6(py, &self.covariance.matrix)
    }

    fn __repr__(&self) -> String {
        let position = self.covariance.position_sigma();
        let attitude = self.covariance.attitude_sigma().to_degrees();
        format!("PosePrior({}, each axis ± {position:.3} m and ± {attitude:.2}°)", self.pose)
    }
}

impl PosePrior {
    /// The prior in the world, for a localizer.
    pub(crate) fn in_world(&self) -> LibraryPrior {
        LibraryPrior { world_from_camera: self.pose.relabel(), covariance: Covariance6::new(self.covariance.matrix) }
    }
}

/// A prior pose with uniform uncertainty: a box about the prediction of each point (the paper's shell).
///
/// Parameters
/// ----------
/// T : array_like, shape (4, 4)
///     The prior pose ``object_from_camera`` (m).
/// half : float
///     Half-size of the box (m): each visible point lies within it of its prediction, along each camera axis.
///
/// Raises
/// ------
/// ValueError
///     `T` is not a rigid motion, or `half` is not positive.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct BoxPrior {
    pose: Transform<Object, Camera>,
    half: f64,
}

#[pymethods]
impl BoxPrior {
    #[new]
    #[expect(non_snake_case, reason = "a transform is a capital letter in the field's papers")]
    fn new(py: Python<'_>, T: &Bound<'_, PyAny>, half: f64) -> PyResult<Self> {
        if !(half > 0.0 && half.is_finite()) {
            return Err(invalid(py, "half", format!("`half` is {half}"), "give a positive half-size in metres"));
        }
        Ok(Self { pose: motion(T, "T")?, half })
    }

    /// ndarray, shape (4, 4): the prior pose.
    #[getter(T)]
    fn pose<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array4(py, &self.pose.matrix())
    }

    /// float: the half-size of the box (m).
    #[getter]
    fn half(&self) -> f64 {
        self.half
    }

    fn __repr__(&self) -> String {
        format!("BoxPrior({}, half {} m)", self.pose, self.half)
    }
}

/// The prior of a problem, from an argument.
pub(crate) fn of_problem(given: &Bound<'_, PyAny>) -> PyResult<Prior> {
    if let Ok(prior) = given.cast::<PosePrior>() {
        let prior = prior.get();
        return Ok(Prior { object_from_camera: prior.pose, bound: PriorBound::Gaussian(prior.covariance) });
    }
    if let Ok(prior) = given.cast::<BoxPrior>() {
        let prior = prior.get();
        return Ok(Prior { object_from_camera: prior.pose, bound: PriorBound::Box(prior.half) });
    }
    Err(invalid(given.py(), "prior", "`prior` is no prior pose", "give a `PosePrior` or a `BoxPrior`"))
}
