//! The answer to a problem.

use std::{borrow::Cow, path::PathBuf, sync::Arc};

use numpy::{PyArray1, PyArray2};
use pyo3::{prelude::*, types::PyDict};
use seafix::{
    geometry::{Camera, Covariance6, Object, Transform},
    referencing::{
        Acceptance, Attempt, Correspondence, Outcome, Search, Solver,
        problem_file::{CoherenceProblem, Method, printed},
    },
};

use crate::{
    array::{array4, array6, table},
    integrity::Integrity,
    invalid::invalid,
};

/// A pose that is not accepted as a fix.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Pose {
    object_from_camera: Transform<Object, Camera>,
    covariance: Option<Covariance6<Object, Camera>>,
    pairs: Vec<Correspondence>,
    /// float or None: the score of the pose, larger is better; for the default search the log evidence (nats).
    #[pyo3(get)]
    score: Option<f64>,
}

#[pymethods]
impl Pose {
    /// ndarray, shape (4, 4): the camera's pose in the object frame (m).
    #[getter]
    fn object_from_camera<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array4(py, &self.object_from_camera.matrix())
    }

    /// ndarray, shape (6, 6), or None: the covariance of ξ = (φ, ρ), in rad² and m².
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.covariance.as_ref().map(|it| array6(py, &it.matrix))
    }

    /// ndarray of int, shape (k, 2): the pairs (model, cloud) that support the pose.
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        pair_table(py, &self.pairs)
    }

    fn __repr__(&self) -> String {
        format!("Pose({}, {} pairs)", self.object_from_camera, self.pairs.len())
    }
}

/// The answer to a problem: a fix, or the reason why there is none.
///
/// `object_from_camera`, `covariance` and `pairs` are None unless the outcome is ``fix``. An answer without a fix has
/// its most probable pose in `best`, for a threshold of the user's own.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Answer {
    pub(crate) attempt: Attempt,
    /// str: the target: the name of the problem, or of the object.
    #[pyo3(get)]
    pub(crate) target: String,
    /// str: the name of the search.
    #[pyo3(get)]
    pub(crate) search: String,
    /// str: the name of the solver.
    #[pyo3(get)]
    pub(crate) solver: String,
    /// float: the processing time (ms), without reading and checking the input.
    #[pyo3(get)]
    pub(crate) time_ms: f64,
    pub(crate) posed: Option<Posed>,
}

/// The problem of an answer, and what answered it.
pub(crate) struct Posed {
    pub(crate) problem: Arc<CoherenceProblem>,
    pub(crate) file: PathBuf,
    pub(crate) search: Arc<dyn Search>,
    pub(crate) solver: Arc<dyn Solver>,
    pub(crate) acceptance: Acceptance,
}

#[pymethods]
impl Answer {
    /// str: the outcome: ``fix``, ``ambiguous``, ``rejected`` or ``degenerate``.
    #[getter]
    fn outcome(&self) -> &'static str {
        self.attempt.outcome.name()
    }

    /// bool: whether the answer is a fix.
    #[getter]
    fn is_fix(&self) -> bool {
        matches!(self.attempt.outcome, Outcome::Fix(_))
    }

    /// ndarray, shape (4, 4), or None: the pose of a fix, ``p_object = T @ p_camera`` (m).
    #[getter]
    fn object_from_camera<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.fix().map(|fix| array4(py, &fix.object_from_camera.matrix()))
    }

    /// ndarray, shape (4, 4), or None: the inverse of the pose of a fix (m).
    #[getter]
    fn camera_from_object<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.fix().map(|fix| array4(py, &fix.object_from_camera.inverse().matrix()))
    }

    /// ndarray, shape (6, 6), or None: the covariance of a fix.
    ///
    /// It is that of ξ = (φ, ρ) in ``T_true = object_from_camera @ Exp(ξ)``, rotation first, along the camera axes
    /// (rad², m²).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.fix().map(|fix| array6(py, &fix.covariance.matrix))
    }

    /// float or None: the standard deviation of the position of a fix along one axis (m), the RMS over the three axes.
    ///
    /// It is the `position_sigma` of a ``PosePrior``.
    #[getter]
    fn position_sigma(&self) -> Option<f64> {
        self.fix().map(|fix| fix.position_sigma())
    }

    /// float or None: the standard deviation of the attitude of a fix about one axis (rad), the RMS over the three axes.
    ///
    /// It is the `attitude_sigma` of a ``PosePrior``.
    #[getter]
    fn attitude_sigma(&self) -> Option<f64> {
        self.fix().map(|fix| fix.attitude_sigma())
    }

    /// Integrity or None: the residual test, the solution separation and the protection levels of a fix.
    #[getter]
    fn integrity(&self) -> Option<Integrity> {
        self.fix().map(|fix| Integrity(fix.integrity))
    }

    /// ndarray of int, shape (k, 2), or None: the identified pairs (model, cloud) of a fix.
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<i64>>> {
        self.fix().map(|fix| pair_table(py, &fix.pairs))
    }

    /// ndarray of int, shape (k, 2), or None: the identified pairs (edge, line) of a fix; no rows without edges.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<i64>>> {
        self.fix().map(|fix| pair_table(py, &fix.edges))
    }

    /// ndarray, shape (k, 3), or None: the residual ``T @ cloud − model`` of each pair of a fix, object frame (m).
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.fix().map(|fix| table(py, &fix.residuals.iter().map(|r| (*r).into()).collect::<Vec<[f64; 3]>>()))
    }

    /// ndarray of int, shape (k,): the cloud points of the set that the search returned; empty if it returned none.
    #[getter]
    fn identified<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.attempt.identified.iter().map(|pair| pair.cloud as i64))
    }

    /// float or None: the probability that the pose of the fix, or of `best`, is not the object's.
    #[getter]
    fn p_wrong(&self) -> Option<f64> {
        self.attempt.p_wrong.filter(|p| p.is_finite())
    }

    /// float or None: the probability that the object is absent.
    #[getter]
    fn p_absent(&self) -> Option<f64> {
        self.attempt.p_absent.filter(|p| p.is_finite())
    }

    /// float or None: the number of false alarms of the identified set.
    #[getter]
    fn nfa(&self) -> Option<f64> {
        self.attempt.nfa.filter(|nfa| nfa.is_finite())
    }

    /// str or None: the reason for a missing fix, in kebab-case.
    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.attempt.outcome.reason()
    }

    /// str or None: the reason for a missing fix as a sentence with its numbers.
    #[getter]
    fn explanation(&self) -> Option<String> {
        self.attempt.outcome.explanation()
    }

    /// str or None: what helps against a missing fix.
    #[getter]
    fn remedy(&self) -> Option<Cow<'static, str>> {
        self.attempt.outcome.remedy()
    }

    /// Pose or None: the most probable pose of an answer that is no fix.
    #[getter]
    fn best(&self) -> Option<Pose> {
        self.attempt.best.as_ref().map(|best| Pose {
            object_from_camera: best.object_from_camera,
            covariance: best.covariance,
            pairs: best.pairs.clone(),
            score: None,
        })
    }

    /// list of Pose: the poses between which the data do not decide; empty unless the outcome is ``ambiguous``.
    #[getter]
    fn alternatives(&self) -> Vec<Pose> {
        let Outcome::Ambiguous(all) = &self.attempt.outcome else { return Vec::new() };
        let pose = |it: &seafix::referencing::Alternative| Pose {
            object_from_camera: it.object_from_camera,
            covariance: None,
            pairs: it.pairs.clone(),
            score: Some(it.score),
        };
        all.iter().map(pose).collect()
    }

    /// float or None: the score of the answer minus that of the next pose.
    #[getter]
    fn margin(&self) -> Option<f64> {
        self.attempt.margin()
    }

    /// bool: whether the search proved that no admissible set is better.
    #[getter]
    fn optimal(&self) -> bool {
        self.attempt.optimal
    }

    /// The answer as JSON, the line that ``seafix solve --json`` prints.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The answer is that of a localizer, which has no problem of its own.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let Some(posed) = &self.posed else {
            let what = "the answer of a localizer has no problem to print";
            return Err(invalid(py, "posed", what, "read its attributes"));
        };
        let method = Method {
            search: (&self.search, &*posed.search),
            solver: (&self.solver, &*posed.solver),
            acceptance: &posed.acceptance,
            expand_gates: false,
        };
        let answer = printed(&self.attempt, &posed.problem, &posed.file, &method, self.time_ms);
        Ok(serde_json::to_string(&answer).expect("an answer is plain data"))
    }

    /// The answer as a dictionary with the keys of ``seafix solve --json``.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let read = py.import("json")?.call_method1("loads", (self.to_json(py)?,))?;
        Ok(read.cast_into::<PyDict>()?)
    }

    fn __repr__(&self) -> String {
        format!("Answer({})", self.attempt.outcome)
    }
}

impl Answer {
    fn fix(&self) -> Option<&seafix::referencing::Fix> {
        match &self.attempt.outcome {
            Outcome::Fix(fix) => Some(fix),
            _ => None,
        }
    }
}

fn pair_table<'py>(py: Python<'py>, pairs: &[Correspondence]) -> Bound<'py, PyArray2<i64>> {
    // Indices are far below the largest integer: a cloud has at most half a million points.
    table(py, &pairs.iter().map(|pair| [pair.model as i64, pair.cloud as i64]).collect::<Vec<_>>())
}
