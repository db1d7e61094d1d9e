//! The laws of solvers and of searches, run on one of them.

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

use pyo3::prelude::*;
use seafix::{
    component::Choice,
    referencing::{SEARCHES, SOLVERS},
};
use seafix_proptests::{
    search_laws as searches,
    searches::named as searches_named,
    solver_laws::{LAWS, named},
};

use crate::{failure, interpreter::text_of, invalid::invalid};

/// The budget of pair tests of a search that has one.
const BUDGET: i64 = 100_000;

/// Run the laws of solvers on one of them.
///
/// Parameters
/// ----------
/// name : str
///     The name of a solver.
///
/// Returns
/// -------
/// list of (str, str or None)
///     Each law, and its smallest counterexample if it is broken.
#[pyfunction]
pub(crate) fn solver_laws(py: Python<'_>, name: &str) -> PyResult<Vec<(&'static str, Option<String>)>> {
    if SOLVERS.names().all(|known| known != name) {
        return Err(invalid(py, "name", format!("no solver is called `{name}`"), "see `solvers()`"));
    }
    if SOLVERS.build(&Choice::named(name)).is_ok_and(|solver| solver.needs_pixels()) {
        let what = format!("`{name}` needs pixels, and the scenes of the laws have none");
        return Err(invalid(py, "name", what, "run `cargo test -p seafix-proptests`"));
    }
    run(py, LAWS.map(|(statement, law)| (statement, move |name: &str| law(&named(name)))), name)
}

/// Run the laws of searches on one of them.
///
/// Parameters
/// ----------
/// name : str
///     The name of a search.
///
/// Returns
/// -------
/// list of (str, str or None)
///     Each law, and its smallest counterexample if it is broken.
#[pyfunction]
pub(crate) fn search_laws(py: Python<'_>, name: &str) -> PyResult<Vec<(&'static str, Option<String>)>> {
    if SEARCHES.names().all(|known| known != name) {
        return Err(invalid(py, "name", format!("no search is called `{name}`"), "see `searches()`"));
    }
    run(
        py,
        searches::LAWS.map(|(statement, law)| (statement, move |name: &str| law(&searches_named(name, BUDGET)))),
        name,
    )
}

/// Each law with its smallest counterexample, if it is broken.
fn run<const N: usize>(
    py: Python<'_>,
    laws: [(&'static str, impl Fn(&str) + Send + Sync); N],
    name: &str,
) -> PyResult<Vec<(&'static str, Option<String>)>> {
    let mut results = Vec::new();
    for (statement, law) in laws {
        py.check_signals()?;
        // A broken law is a panic, whose message is returned instead of printed.
        let hook = take_hook();
        set_hook(Box::new(|_| {}));
        let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| law(name))));
        set_hook(hook);
        if let Some(error) = failure::taken() {
            return Err(error);
        }
        results.push((statement, result.err().map(|panic| text_of(&*panic).to_owned())));
    }
    Ok(results)
}
