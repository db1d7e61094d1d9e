//! The choice of a component by an argument.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

use pyo3::{
    prelude::*,
    types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple},
};
use seafix::component::{Choice, Registry};

use crate::{
    invalid::{invalid, stated},
    own::is_own,
};

/// Components with default settings, built once.
pub(crate) struct Built<T: ?Sized>(Mutex<Option<HashMap<String, Arc<T>>>>);

impl<T: ?Sized> Built<T> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(None))
    }

    /// The component that an argument chooses: a name, or a dictionary with a `name` and settings.
    pub(crate) fn component(
        &self,
        registry: &'static Registry<T>,
        chosen: &Bound<'_, PyAny>,
    ) -> PyResult<(String, Arc<T>)> {
        let py = chosen.py();
        let Ok(name) = chosen.cast::<PyString>() else {
            let choice = choice(chosen, registry.kind())?;
            return Ok((choice.name.clone(), build(py, registry, &choice)?));
        };
        let name = name.to_cow()?;
        // A component written in Python may be declared anew, as in a notebook.
        if is_own(registry.kind(), &name) {
            return Ok((name.clone().into_owned(), build(py, registry, &Choice::named(&name))?));
        }
        let mut guard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = guard.get_or_insert_default();
        if let Some(built) = known.get(&*name) {
            return Ok((name.into_owned(), Arc::clone(built)));
        }
        let built = build(py, registry, &Choice::named(&name))?;
        known.insert(name.clone().into_owned(), Arc::clone(&built));
        Ok((name.into_owned(), built))
    }
}

fn build<T: ?Sized>(py: Python<'_>, registry: &'static Registry<T>, choice: &Choice) -> PyResult<Arc<T>> {
    let built = registry.build(choice).map_err(|error| stated(py, registry.kind(), &error.to_string()))?;
    Ok(Arc::from(built))
}

/// A component's name, or a dictionary with `name` and settings; keys may have underscores for hyphens.
pub(crate) fn choice(chosen: &Bound<'_, PyAny>, field: &str) -> PyResult<Choice> {
    if let Ok(name) = chosen.extract::<String>() {
        return Ok(Choice::named(&name));
    }
    let py = chosen.py();
    let remedy = "give a name, or a dictionary with `name` and settings";
    let wrong = || invalid(py, field, format!("`{field}` names no component"), remedy);
    let toml::Value::Table(mut settings) = value(chosen, field)? else { return Err(wrong()) };
    match settings.remove("name") {
        Some(toml::Value::String(name)) => Ok(Choice { name, settings }),
        _ => Err(wrong()),
    }
}

/// A Python value as a TOML value.
pub(crate) fn value(given: &Bound<'_, PyAny>, field: &str) -> PyResult<toml::Value> {
    // A bool is an int in Python, so it is asked for first.
    if given.is_instance_of::<PyBool>() {
        return Ok(toml::Value::Boolean(given.extract()?));
    }
    if given.is_instance_of::<PyInt>() {
        return Ok(toml::Value::Integer(given.extract()?));
    }
    if given.is_instance_of::<PyFloat>() {
        return Ok(toml::Value::Float(given.extract()?));
    }
    if given.is_instance_of::<PyString>() {
        return Ok(toml::Value::String(given.extract()?));
    }
    if let Ok(dictionary) = given.cast::<PyDict>() {
        let entries = dictionary.iter().map(|(key, given)| {
            let key: String = key.extract()?;
            let value = value(&given, &key)?;
            Ok((key.replace('_', "-"), value))
        });
        return Ok(toml::Value::Table(entries.collect::<PyResult<_>>()?));
    }
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        let items = given.try_iter()?.map(|item| value(&item?, field));
        return Ok(toml::Value::Array(items.collect::<PyResult<_>>()?));
    }
    // A number of numpy is neither an int nor a float.
    if let Ok(number) = given.extract::<f64>() {
        return Ok(toml::Value::Float(number));
    }
    let what = format!("`{field}` is a {}", given.get_type().name()?);
    Err(invalid(given.py(), field, what, "give a number, a text, a list or a dictionary"))
}
