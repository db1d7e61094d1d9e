//! The registered components.

use pyo3::{prelude::*, types::PyDict};
use seafix::{
    component::Listing,
    referencing::{SEARCHES, SOLVERS},
    vision::DETECTORS,
};

/// The names of the registered searches.
///
/// Returns
/// -------
/// list of str
#[pyfunction]
pub(crate) fn searches() -> Vec<&'static str> {
    SEARCHES.names().collect()
}

/// The names of the registered solvers.
///
/// Returns
/// -------
/// list of str
#[pyfunction]
pub(crate) fn solvers() -> Vec<&'static str> {
    SOLVERS.names().collect()
}

/// The names of the registered detectors of key points.
///
/// Returns
/// -------
/// list of str
#[pyfunction]
pub(crate) fn detectors() -> Vec<&'static str> {
    DETECTORS.names().collect()
}

/// Describe a registered search, solver or detector.
///
/// Parameters
/// ----------
/// name : str
///     Its name.
///
/// Returns
/// -------
/// dict
///     ``kind``, ``summary``, ``source``, and ``settings``, the default settings as TOML.
///
/// Raises
/// ------
/// ValueError
///     No component has this name.
#[pyfunction]
pub(crate) fn describe<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
    let all: Vec<Listing> = [SEARCHES.listings(), SOLVERS.listings(), DETECTORS.listings()].concat();
    // A search and a solver may share a name; the search is meant then, as it is the first stage.
    let found = all.iter().find(|listing| listing.name == name);
    let Some(listing) = found else {
        let remedy = "see `searches()`, `solvers()` and `detectors()`";
        return Err(crate::invalid::invalid(
            py,
            "name",
            format!("no search, solver or detector is called `{name}`"),
            remedy,
        ));
    };
    let about = PyDict::new(py);
    about.set_item("kind", listing.kind)?;
    about.set_item("summary", listing.summary)?;
    about.set_item("source", listing.source)?;
    about.set_item("settings", toml::to_string(&listing.table.defaults).unwrap_or_default())?;
    Ok(about)
}
