//! Searches written in Python.

use std::fmt;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::{prelude::*, types::PyDict};
use rand::Rng;
use seafix::{
    component::{Added, Construct},
    geometry::MeasuredPoint,
    referencing::{
        Candidates, Correspondence, Identification, ModelPoint, Prior, Problem, Rejected, SEARCHES, Search, Tolerance,
    },
};

use crate::{
    array::{array4, covariance_table, index_pairs, table},
    failure,
    invalid::{invalid, stated},
    own::{self, Declared},
};

/// Largest number of candidate pairs in a compatibility matrix; it then has 100 MB.
const MAX_PAIRS: usize = 10_000;

/// The input of a search written in Python.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct SearchProblem {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
    tolerance: Tolerance,
    prior: Option<Prior>,
    /// int: a seed for random numbers, ``numpy.random.default_rng(problem.seed)``.
    #[pyo3(get)]
    seed: u64,
}

#[pymethods]
impl SearchProblem {
    /// ndarray, shape (n, 3): the model points, object frame (m).
    #[getter]
    fn model<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        table(py, &self.model.iter().map(|point| point.at.coords.into()).collect::<Vec<[f64; 3]>>())
    }

    /// ndarray, shape (m, 3): the measured points, camera frame (m).
    #[getter]
    fn cloud<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        table(py, &self.cloud.iter().map(|point| point.position.at.coords.into()).collect::<Vec<[f64; 3]>>())
    }

    /// ndarray, shape (m, 3, 3): the covariance of each measured point (m²).
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        covariance_table(py, self.cloud.iter().map(|point| point.position.covariance))
    }

    /// list of ndarray of int: for each model point its candidates, indices of cloud points.
    #[getter]
    fn candidates<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<i64>>> {
        self.candidates.lists.iter().map(|list| PyArray1::from_iter(py, list.iter().map(|&k| k as i64))).collect()
    }

    /// ndarray of int, shape (k, 2): all candidate pairs (model, cloud), in the order of the model.
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        table(py, &self.all_pairs().iter().map(|pair| [pair.model as i64, pair.cloud as i64]).collect::<Vec<_>>())
    }

    /// ndarray, shape (4, 4), or None: the prior pose ``object_from_camera``.
    #[getter]
    fn prior<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.prior.as_ref().map(|prior| array4(py, &prior.object_from_camera.matrix()))
    }

    /// The structural coherence of all candidate pairs.
    ///
    /// Two pairs are coherent if their model points differ, their cloud points differ, and their distances in model
    /// and cloud differ by at most Δ.
    ///
    /// Returns
    /// -------
    /// ndarray of bool, shape (k, k)
    ///     Symmetric, in the order of `pairs`; the diagonal is False.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     More than 10 000 candidate pairs.
    fn compatibility<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let pairs = self.all_pairs();
        if pairs.len() > MAX_PAIRS {
            let what = format!("{} candidate pairs are too many for a matrix", pairs.len());
            return Err(invalid(py, "pairs", what, "narrow the prior or use `candidates`"));
        }
        let count = pairs.len();
        let flat = py.detach(|| {
            let problem = self.problem();
            let mut flat = vec![false; count * count];
            for (a, &p) in pairs.iter().enumerate() {
                for (b, &q) in pairs.iter().enumerate().take(a) {
                    let coherent = problem.coherent(p, q);
                    (flat[a * count + b], flat[b * count + a]) = (coherent, coherent);
                }
            }
            flat
        });
        PyArray1::from_vec(py, flat).reshape([count, count])
    }
}

impl SearchProblem {
    fn of(problem: &Problem<'_>, seed: u64) -> Self {
        Self {
            model: problem.model.to_vec(),
            cloud: problem.cloud.to_vec(),
            candidates: problem.candidates.clone(),
            tolerance: problem.tolerance,
            prior: problem.prior.cloned(),
            seed,
        }
    }

    fn problem(&self) -> Problem<'_> {
        let Self { model, cloud, candidates, tolerance, prior, .. } = self;
        Problem { model, cloud, candidates, tolerance: *tolerance, prior: prior.as_ref(), edges: Default::default() }
    }

    fn all_pairs(&self) -> Vec<Correspondence> {
        let lists = self.candidates.lists.iter().enumerate();
        lists.flat_map(|(model, list)| list.iter().map(move |&cloud| Correspondence { model, cloud })).collect()
    }
}

/// A search that calls a Python function.
struct PythonSearch {
    function: Py<PyAny>,
    settings: Py<PyDict>,
}

impl fmt::Debug for PythonSearch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PythonSearch")
    }
}

impl PythonSearch {
    fn called(&self, py: Python<'_>, problem: &Problem<'_>, seed: u64) -> PyResult<Vec<Correspondence>> {
        let input = Bound::new(py, SearchProblem::of(problem, seed))?;
        let given = self.function.bind(py).call((input,), Some(self.settings.bind(py)))?;
        if given.is_none() {
            return Ok(Vec::new());
        }
        let mut pairs: Vec<Correspondence> =
            index_pairs(&given, "pairs")?.into_iter().map(|[model, cloud]| Correspondence { model, cloud }).collect();
        pairs.sort_unstable();
        let is_candidate = |pair: &Correspondence| {
            problem.candidates.lists.get(pair.model).is_some_and(|list| list.contains(&pair.cloud))
        };
        if let Some(pair) = pairs.iter().find(|pair| !is_candidate(pair)) {
            let what = format!("the pair ({}, {}) is no candidate", pair.model, pair.cloud);
            return Err(invalid(py, "pairs", what, "return rows of `problem.pairs`"));
        }
        let mut clouds: Vec<usize> = pairs.iter().map(|pair| pair.cloud).collect();
        clouds.sort_unstable();
        clouds.dedup();
        let twice = pairs.windows(2).any(|two| two[0].model == two[1].model) || clouds.len() < pairs.len();
        if twice {
            return Err(invalid(py, "pairs", "a point has two partners", "return each model and cloud point once"));
        }
        Ok(pairs)
    }
}

impl Search for PythonSearch {
    fn search(&self, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let seed = rng.next_u64();
        let bound = problem.candidates.with_candidates();
        let pairs = Python::attach(|py| {
            self.called(py, problem, seed).unwrap_or_else(|error| {
                failure::keep(py, error);
                Vec::new()
            })
        });
        if pairs.len() < 3 {
            return Err(Rejected::NotFound { bound, needed: 3 });
        }
        Ok(Identification::unproved(pairs, bound, 0))
    }
}

/// Register a Python function as a search.
///
/// Parameters
/// ----------
/// function : callable
///     ``function(problem, **settings) -> pairs`` with a :class:`SearchProblem` and an array (k, 2) of pairs, or None.
/// declared : dict
///     ``name``, ``summary``, ``source``, ``version`` and ``defaults``.
#[pyfunction]
pub(crate) fn add_search(py: Python<'_>, function: Py<PyAny>, declared: &Bound<'_, PyDict>) -> PyResult<()> {
    let Declared { name, summary, source, version, defaults } = own::declared(declared)?;
    let construct: Construct<dyn Search> = Box::new(move |settings| {
        Python::attach(|py| {
            let settings = own::keywords(py, settings).map_err(|error| error.to_string())?.unbind();
            Ok(Box::new(PythonSearch { function: function.clone_ref(py), settings }) as Box<dyn Search>)
        })
    });
    let added = SEARCHES.add(Added { name: name.clone(), summary, source, version, defaults, construct });
    added.map_err(|error| stated(py, "name", &error.to_string()))?;
    own::remember("search", &name);
    Ok(())
}
