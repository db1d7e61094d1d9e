//! The pose of one problem.

use std::{
    sync::{Arc, LazyLock},
    time::Instant,
};

use pyo3::{prelude::*, types::PyString};
use seafix::{
    component::Choice,
    referencing::{Acceptance, MaxPWrong, SEARCHES, SOLVERS, Search, Solver, problem_file::Method},
};
use seafix_simulation::{Purpose, Stream};

use crate::{
    answer::{Answer, Posed},
    choice::{Built, value},
    failure,
    interpreter::{detached, interruptible},
    invalid::{invalid, stated},
    own::is_own,
    problem::Problem,
};

static BUILT_SEARCHES: Built<dyn Search> = Built::new();
pub(crate) static BUILT_SOLVERS: Built<dyn Solver> = Built::new();

/// Number of candidate pairs above which a search has a thread of its own, so that Ctrl-C ends the wait for it.
///
/// Starting a thread costs about a hundred microseconds, which only a longer search does not notice. A search among
/// fewer pairs ends within its default budget; one with another budget has a thread as well.
const LONG: usize = 5_000;

/// Identify the model points in the cloud and compute the camera's pose.
///
/// Parameters
/// ----------
/// problem : Problem
///     Model, cloud, noise, prior and tolerance.
/// search : str or dict, default "rigid-consensus"
///     A registered search (see :func:`searches`), or a dictionary of its `name` and settings.
/// solver : str or dict, default "mahalanobis"
///     A registered solver (see :func:`solvers`) that needs no pixels, or a dictionary of its `name` and settings.
/// max_p_wrong : float or {"strict", "balanced", "permissive"}, default 1e-3
///     Largest probability of a wrong answer at which a pose is accepted as a fix.
/// acceptance : dict, optional
///     Other settings of the acceptance tests, such as ``{"alert_limit": 0.05}`` (m).
/// expand_gates : bool, default False
///     Repeat a search without a fix with larger gates, then without gates, for a displaced object.
/// seed : int, default 0
///     Seed of searches that draw random numbers. Equal seeds give equal bytes.
///
/// Returns
/// -------
/// Answer
///     A fix, or the reason for its rejection. Data without an answer are no exception.
///
/// Raises
/// ------
/// ValueError
///     An unknown component or setting, or a value out of its range.
///
/// Notes
/// -----
/// The interpreter's lock is released, so that threads solve problems at the same time. The numbers are those of
/// ``seafix solve``, bit by bit.
///
/// Examples
/// --------
/// >>> problem = sf.Problem.load("problem.json")
/// >>> answer = sf.solve(problem, max_p_wrong=1e-3)
/// >>> answer.outcome
/// 'fix'
#[pyfunction]
#[pyo3(signature = (problem, search=None, solver=None, max_p_wrong=None, *, acceptance=None, expand_gates=false, seed=0))]
#[expect(clippy::too_many_arguments, reason = "they are the settings of a method, named in Python")]
pub(crate) fn solve(
    py: Python<'_>,
    problem: &Bound<'_, Problem>,
    search: Option<&Bound<'_, PyAny>>,
    solver: Option<&Bound<'_, PyAny>>,
    max_p_wrong: Option<&Bound<'_, PyAny>>,
    acceptance: Option<&Bound<'_, PyAny>>,
    expand_gates: bool,
    seed: u64,
) -> PyResult<Answer> {
    let default_budget = search.is_none_or(|given| given.is_instance_of::<PyString>());
    let search =
        BUILT_SEARCHES.component(&SEARCHES, search.unwrap_or(PyString::intern(py, "rigid-consensus").as_any()))?;
    let solver = BUILT_SOLVERS.component(&SOLVERS, solver.unwrap_or(PyString::intern(py, "mahalanobis").as_any()))?;
    if solver.1.needs_pixels() {
        let what = format!("cannot solve with `{}`: it needs pixels and a rig", solver.0);
        return Err(invalid(py, "solver", what, "use `mahalanobis`"));
    }
    let acceptance = limits(py, max_p_wrong, acceptance)?;
    let Problem { inner, tolerance, file } = problem.get();
    let (problem, tolerance, file) = (Arc::clone(inner), *tolerance, file.clone());
    let own = is_own("search", &search.0) || is_own("solver", &solver.0);
    let most = problem.putative.as_ref().map_or(problem.model.len() * problem.cloud.len(), Vec::len);
    let work = move || {
        let start = Instant::now();
        let method = Method {
            search: (&search.0, &*search.1),
            solver: (&solver.0, &*solver.1),
            acceptance: &acceptance,
            expand_gates,
        };
        let mut stream = Stream::new(seed, 0, 0, Purpose::Search);
        let attempt = problem.attempt_within(tolerance, &method, stream.rng());
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        let posed = Posed { problem, file, search: search.1, solver: solver.1, acceptance };
        Answer {
            attempt,
            target: posed.problem.id.clone(),
            search: search.0,
            solver: solver.0,
            time_ms,
            posed: Some(posed),
        }
    };
    // A component written in Python is called on this thread, where the interpreter raises for Ctrl-C by itself.
    let long = most > LONG || !default_budget;
    let answer = if long && !own { interruptible(py, work) } else { detached(py, work) };
    match failure::taken() {
        Some(error) if own => Err(error),
        _ => answer,
    }
}

static DEFAULT: LazyLock<Acceptance> = LazyLock::new(Acceptance::default);

/// The limits of the acceptance tests, from two arguments.
pub(crate) fn limits(
    py: Python<'_>,
    max_p_wrong: Option<&Bound<'_, PyAny>>,
    acceptance: Option<&Bound<'_, PyAny>>,
) -> PyResult<Acceptance> {
    let mut limits = match acceptance {
        None => DEFAULT.clone(),
        Some(given) => {
            let name = Choice::named("acceptance").name;
            let read = value(given, &name)?.try_into::<Acceptance>();
            read.map_err(|error| stated(py, &name, &format!("`acceptance`: {}", error.message().trim_end())))?
        }
    };
    if let Some(given) = max_p_wrong {
        limits.max_p_wrong = match given.extract::<f64>() {
            Ok(number) => MaxPWrong::Number(number),
            Err(_) => {
                let word: String = given.extract().unwrap_or_default();
                let known = MaxPWrong::PRESETS.into_iter().find(|preset| preset.preset() == Some(&word));
                let remedy = "give a probability above 0, at most 1, or strict, balanced or permissive";
                known.ok_or_else(|| invalid(py, "max_p_wrong", "`max_p_wrong` is no probability", remedy))?
            }
        };
    }
    limits.check().map_err(|message| stated(py, "acceptance", &message))?;
    Ok(limits)
}
