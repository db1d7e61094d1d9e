//! One identification problem: model, cloud, prior and tolerance.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use seafix::referencing::{
    Tolerance,
    problem_file::{CoherenceProblem, Noise, Parts, read},
};

use crate::{
    array::{covariance_table, covariances, dimensions, end_table, index_pairs, rows, table, vector},
    edges::EdgeArguments,
    interpreter::detached,
    invalid::{in_file, invalid, with_attributes},
    prior::of_problem,
};

/// The tolerance without a Δ: three standard deviations of the two distances, as in the default pipeline.
const TOLERANCE: Tolerance = Tolerance::Sigmas(3.0);

/// An identification problem: which cloud points are the model points, and where is the camera?
///
/// Parameters
/// ----------
/// model : array_like, shape (n, 3)
///     Feature points of the object, object frame (m).
/// cloud : array_like, shape (m, 3)
///     Measured points, camera frame: x right, y down, z forward (m).
/// covariances : array_like, shape (m, 3, 3) or (3, 3), optional
///     Covariance of each measured point, camera axes (m²).
/// prior : PosePrior or BoxPrior, optional
///     Prior pose of the camera in the object frame. Without one every cloud point is a candidate of every model point.
/// delta : float, optional
///     Distance tolerance Δ (m): two pairs agree if their distances in model and cloud differ by at most Δ. Without one
///     the tolerance is three standard deviations of the two distances.
/// putative : array_like of int, shape (k, 2), optional
///     Pairs (model, cloud), counted from 0; no other pairs are considered.
/// sigma : float or array_like, shape (m, 3), optional
///     Standard deviation of a measured point along each axis (m), in place of `covariances`.
/// edges : sequence of pairs of ends, or array_like, shape (e, 2, 3), optional
///     The two ends of each straight edge of the object. An end is a place in the object frame (m), or the index of a
///     model point, from 0, whose error the edge then has.
/// lines : array_like, shape (l, 2, 3), optional
///     Two places on each measured line, camera frame (m), as far apart as it was seen.
/// line_covariances : array_like, shape (l, 4, 4) or (4, 4), optional
///     Covariance of four offsets of each line (m²): of the first end along n₁ and n₂, and of the second end along both.
///     With the unit direction d of the line and the coordinate axis e of the smallest ``abs(d @ e)``, n₁ is
///     ``e - d * (d @ e)``, normalised, and n₂ = d × n₁. Required with `lines`.
/// putative_edges : array_like of int, shape (k, 2), optional
///     Pairs (edge, line), counted from 0; no other pairs of them are considered.
///
/// Raises
/// ------
/// ValueError
///     An array of another shape, a number that is not finite or out of its range, coincident model points, an index
///     out of range, or no statement of the noise. The exception has the attributes ``field`` and ``remedy``.
///
/// Notes
/// -----
/// With `delta` but neither `covariances` nor `sigma`, the standard deviation is Δ / (3 √2): at that noise nearly all
/// true pairs agree.
///
/// The searches ``rigid-consensus``, ``maximum-clique`` and ``ransac`` identify edges and the solver ``mahalanobis`` uses them; others use points alone.
///
/// References
/// ----------
/// Bobkov, Kudryashov and Inzartsev, *J. Mar. Sci. Eng.* 2021, 9, 1038.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Problem {
    pub(crate) inner: Arc<CoherenceProblem>,
    pub(crate) tolerance: Tolerance,
    pub(crate) file: PathBuf,
}

#[pymethods]
impl Problem {
    #[new]
    #[pyo3(signature = (
        model, cloud, covariances=None, prior=None, delta=None, putative=None, *, sigma=None, edges=None, lines=None,
        line_covariances=None, putative_edges=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are the parts of a problem, named in Python")]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        cloud: &Bound<'_, PyAny>,
        covariances: Option<&Bound<'_, PyAny>>,
        prior: Option<&Bound<'_, PyAny>>,
        delta: Option<f64>,
        putative: Option<&Bound<'_, PyAny>>,
        sigma: Option<&Bound<'_, PyAny>>,
        edges: Option<&Bound<'_, PyAny>>,
        lines: Option<&Bound<'_, PyAny>>,
        line_covariances: Option<&Bound<'_, PyAny>>,
        putative_edges: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let edges = EdgeArguments { edges, lines, line_covariances, putative: putative_edges }.parts(py)?;
        let model = rows::<3>(model, "model", "(n, 3)")?;
        let cloud = rows::<3>(cloud, "cloud", "(m, 3)")?;
        let parts = Parts {
            id: String::new(),
            noise: noise(py, covariances, sigma, delta, cloud.len())?,
            model,
            cloud,
            delta,
            prior: prior.map(of_problem).transpose()?,
            putative: putative.map(|given| index_pairs(given, "putative")).transpose()?,
            edges,
        };
        let inner = detached(py, || parts.checked())?.map_err(|fault| {
            let error = pyo3::exceptions::PyValueError::new_err(fault.to_string());
            with_attributes(py, error, fault.path.first().map_or("", String::as_str), &fault.remedy)
        })?;
        let tolerance = delta.map_or(TOLERANCE, Tolerance::Fixed);
        Ok(Self { inner: Arc::new(inner), tolerance, file: PathBuf::new() })
    }

    /// The problem in a file of the format ``coherence-problem/1``.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ValueError
    ///     The first fault of the file, with line, column, value and remedy.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = detached(py, || read(Path::new(&path)))?;
        let inner = read.map_err(|fault| in_file(py, &fault))?;
        Ok(Self { tolerance: inner.tolerance(), inner: Arc::new(inner), file: path })
    }

    /// str: the name of the problem; empty for one made of arrays.
    #[getter]
    fn id(&self) -> &str {
        &self.inner.id
    }

    /// ndarray, shape (n, 3): the model points, object frame (m).
    #[getter]
    fn model<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let rows: Vec<[f64; 3]> = self.inner.model.iter().map(|point| point.at.coords.into()).collect();
        table(py, &rows)
    }

    /// ndarray, shape (m, 3): the measured points, camera frame (m).
    #[getter]
    fn cloud<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let rows: Vec<[f64; 3]> = self.inner.cloud.iter().map(|point| point.position.at.coords.into()).collect();
        table(py, &rows)
    }

    /// ndarray, shape (m, 3, 3): the covariance of each measured point, camera axes (m²).
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        covariance_table(py, self.inner.cloud.iter().map(|point| point.position.covariance))
    }

    /// ndarray, shape (e, 2, 3): the ends of the straight edges, object frame (m).
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let edges = self.inner.edges.model.iter();
        end_table(py, edges.map(|edge| edge.places(&self.inner.model).map(|place| place.coords.into())))
    }

    /// ndarray, shape (l, 2, 3): two places on each measured line, camera frame (m).
    #[getter]
    fn lines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        end_table(py, self.inner.edges.lines.iter().map(|line| line.ends.map(|end| end.coords.into())))
    }

    /// float or None: the distance tolerance Δ (m); None for three standard deviations of the distances.
    #[getter]
    fn delta(&self) -> Option<f64> {
        match self.tolerance {
            Tolerance::Fixed(delta) => Some(delta),
            Tolerance::Sigmas(_) => None,
        }
    }

    fn __repr__(&self) -> String {
        let inner = &self.inner;
        let prior = if inner.prior.is_some() { "a prior" } else { "no prior" };
        let (edges, lines) = (inner.edges.model.len(), inner.edges.lines.len());
        let edges = if edges + lines > 0 { format!("{edges} edges, {lines} lines, ") } else { String::new() };
        format!("Problem({} model points, {} cloud points, {edges}{prior})", inner.model.len(), inner.cloud.len())
    }
}

/// The noise of the cloud, from one of three arguments.
fn noise(
    py: Python<'_>,
    given: Option<&Bound<'_, PyAny>>,
    sigma: Option<&Bound<'_, PyAny>>,
    delta: Option<f64>,
    count: usize,
) -> PyResult<Noise> {
    match (given, sigma, delta) {
        (Some(_), Some(_), _) => {
            Err(invalid(py, "sigma", "both `covariances` and `sigma` are given", "give one of them"))
        }
        (Some(given), None, _) => Ok(Noise::Covariances(covariances(given, "covariances", count)?)),
        (None, Some(sigma), _) => match dimensions(sigma, "sigma")? {
            0 => Ok(Noise::Sigma(sigma.extract()?, None)),
            1 => {
                let each = vector(sigma, "sigma", "(m,)")?;
                Ok(Noise::Sigma(0.0, Some(each.into_iter().map(|sigma| [sigma; 3]).collect())))
            }
            _ => Ok(Noise::Sigma(0.0, Some(rows::<3>(sigma, "sigma", "(m, 3)")?))),
        },
        // Nearly all true pairs agree at three standard deviations of a difference of two distances.
        (None, None, Some(delta)) => Ok(Noise::Sigma((delta / (3.0 * 2f64.sqrt())).max(0.0), None)),
        (None, None, None) => {
            let remedy = "give `covariances` (m, 3, 3) in m², `sigma` in m, or `delta` in m";
            Err(invalid(py, "covariances", "the noise of the cloud is not stated", remedy))
        }
    }
}
