//! What components written in Python have in common: their declaration and their settings.

use std::{
    collections::BTreeSet,
    sync::{Mutex, PoisonError},
};

use pyo3::{
    prelude::*,
    types::{PyDict, PyList},
};

use crate::{choice::value, invalid::invalid};

/// The declaration of a component.
pub(crate) struct Declared {
    pub(crate) name: String,
    pub(crate) summary: String,
    pub(crate) source: String,
    pub(crate) version: u32,
    pub(crate) defaults: toml::Table,
}

/// The declaration in a dictionary.
pub(crate) fn declared(given: &Bound<'_, PyDict>) -> PyResult<Declared> {
    let entry =
        |key: &str| given.get_item(key)?.ok_or_else(|| invalid(given.py(), key, format!("no `{key}`"), "give it"));
    let toml::Value::Table(defaults) = value(&entry("defaults")?, "defaults")? else {
        return Err(invalid(given.py(), "defaults", "`defaults` is no dictionary", "give settings by name"));
    };
    Ok(Declared {
        name: entry("name")?.extract()?,
        summary: entry("summary")?.extract()?,
        source: entry("source")?.extract()?,
        version: entry("version")?.extract()?,
        defaults,
    })
}

/// Settings as keyword arguments; hyphens become underscores.
pub(crate) fn keywords<'py>(py: Python<'py>, settings: &toml::Table) -> PyResult<Bound<'py, PyDict>> {
    let keywords = PyDict::new(py);
    for (key, value) in settings {
        keywords.set_item(key.replace('-', "_"), object(py, value)?)?;
    }
    Ok(keywords)
}

fn object<'py>(py: Python<'py>, value: &toml::Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        toml::Value::Boolean(given) => given.into_pyobject(py)?.to_owned().into_any(),
        toml::Value::Integer(given) => given.into_pyobject(py)?.into_any(),
        toml::Value::Float(given) => given.into_pyobject(py)?.into_any(),
        toml::Value::String(given) => given.into_pyobject(py)?.into_any(),
        toml::Value::Datetime(given) => given.to_string().into_pyobject(py)?.into_any(),
        toml::Value::Array(items) => {
            let items = items.iter().map(|item| object(py, item)).collect::<PyResult<Vec<_>>>()?;
            PyList::new(py, items)?.into_any()
        }
        toml::Value::Table(table) => keywords(py, table)?.into_any(),
    })
}

static OWN: Mutex<BTreeSet<(&'static str, String)>> = Mutex::new(BTreeSet::new());

/// Remembers that the component of this kind and name is written in Python.
pub(crate) fn remember(kind: &'static str, name: &str) {
    OWN.lock().unwrap_or_else(PoisonError::into_inner).insert((kind, name.to_owned()));
}

/// Whether the component of this kind and name is written in Python.
pub(crate) fn is_own(kind: &'static str, name: &str) -> bool {
    let own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    !own.is_empty() && own.contains(&(kind, name.to_owned()))
}
