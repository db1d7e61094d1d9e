//! Solvers written in Python.

use std::fmt;

use pyo3::{prelude::*, types::PyDict};
use seafix::{
    component::{Added, Construct},
    geometry::{Camera, Object, Transform},
    referencing::{Degenerate, Observation, Observations, SOLVERS, Solver},
};

use crate::{
    array::{covariance_table, motion, table},
    failure,
    invalid::{DegenerateError, invalid, stated},
    own::{self, Declared},
};

/// A solver that calls a Python function.
struct PythonSolver {
    name: String,
    function: Py<PyAny>,
    settings: Py<PyDict>,
    minimum: usize,
    least_squares: bool,
    to_rounding: bool,
}

impl fmt::Debug for PythonSolver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PythonSolver").field("minimum", &self.minimum).finish_non_exhaustive()
    }
}

impl PythonSolver {
    fn called(&self, py: Python<'_>, data: &Observations<'_>) -> PyResult<Transform<Object, Camera>> {
        let src: Vec<[f64; 3]> = data.points.iter().map(|point| point.measured.at.coords.into()).collect();
        let dst: Vec<[f64; 3]> = data.points.iter().map(|point| point.model.coords.into()).collect();
        let noise = covariance_table(py, data.points.iter().map(Observation::noise))?;
        let arguments = (table(py, &src), table(py, &dst), noise);
        let given = self.function.bind(py).call(arguments, Some(self.settings.bind(py)))?;
        if given.is_none() {
            let what = format!("the solver `{}` returned None", self.name);
            return Err(invalid(py, &self.name, what, "return a rigid motion of shape (4, 4)"));
        }
        motion(&given, "T")
    }
}

impl Solver for PythonSolver {
    fn minimum(&self) -> usize {
        self.minimum
    }

    fn least_squares(&self) -> bool {
        self.least_squares
    }

    fn to_rounding(&self) -> bool {
        self.to_rounding
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        if data.points.len() < self.minimum {
            return Err(Degenerate::TooFew { found: data.points.len(), needed: self.minimum });
        }
        Python::attach(|py| {
            self.called(py, data).map_err(|error| {
                let text = error.value(py).to_string();
                if !error.is_instance_of::<DegenerateError>(py) {
                    failure::keep(py, error);
                }
                Degenerate::Stated(text)
            })
        })
    }
}

/// Register a Python function as a solver.
///
/// Parameters
/// ----------
/// function : callable
///     ``function(src, dst, covariances, **settings) -> T`` with arrays of shape (n, 3), (n, 3) and (n, 3, 3).
/// declared : dict
///     ``name``, ``summary``, ``source``, ``version`` and ``defaults``.
/// minimum : int
///     Minimum number of points.
/// least_squares : bool
///     Whether the motion minimises the sum of squared, unweighted residuals.
/// exact : bool
///     Whether the motion is exact to rounding.
#[pyfunction]
pub(crate) fn add_solver(
    py: Python<'_>,
    function: Py<PyAny>,
    declared: &Bound<'_, PyDict>,
    minimum: usize,
    least_squares: bool,
    exact: bool,
) -> PyResult<()> {
    if minimum < 3 {
        let what = format!("`minimum` is {minimum}");
        return Err(invalid(py, "minimum", what, "give 3 or more; fewer points determine no motion"));
    }
    let Declared { name, summary, source, version, defaults } = own::declared(declared)?;
    let called = name.clone();
    let construct: Construct<dyn Solver> = Box::new(move |settings| {
        Python::attach(|py| {
            let settings = own::keywords(py, settings).map_err(|error| error.to_string())?.unbind();
            let function = function.clone_ref(py);
            let name = called.clone();
            Ok(Box::new(PythonSolver { name, function, settings, minimum, least_squares, to_rounding: exact })
                as Box<dyn Solver>)
        })
    });
    let added = SOLVERS.add(Added { name: name.clone(), summary, source, version, defaults, construct });
    added.map_err(|error| stated(py, "name", &error.to_string()))?;
    own::remember("solver", &name);
    Ok(())
}
