//! Python exceptions for invalid input.

use std::fmt::Display;

use pyo3::{
    create_exception,
    exceptions::{PyOSError, PyValueError},
    prelude::*,
};
use seafix_component::Fault;

create_exception!(
    seafix,
    DegenerateError,
    PyValueError,
    "Points that determine no pose. The message states the failed test with its number and the remedy."
);

/// The `ValueError` of an invalid argument; the exception has the attributes `field` and `remedy`.
pub(crate) fn invalid(py: Python<'_>, field: &str, what: impl Display, remedy: impl Display) -> PyErr {
    let remedy = remedy.to_string();
    let error = PyValueError::new_err(format!("{what}; {remedy}"));
    with_attributes(py, error, field, &remedy)
}

/// The exception with the attributes `field` and `remedy`.
pub(crate) fn with_attributes(py: Python<'_>, error: PyErr, field: &str, remedy: &str) -> PyErr {
    let value = error.value(py);
    let set = value.setattr("field", field).and_then(|()| value.setattr("remedy", remedy));
    set.err().unwrap_or(error)
}

/// The `ValueError` of a message that ends with its remedy, as the library's messages do: `what; remedy`.
///
/// A message about an unknown name has the known ones after a comma.
pub(crate) fn stated(py: Python<'_>, field: &str, message: &str) -> PyErr {
    let remedy = message.rsplit_once("; ").or_else(|| message.split_once(", ")).map_or("", |(_, remedy)| remedy);
    with_attributes(py, PyValueError::new_err(message.to_owned()), field, remedy)
}

/// The exception of a fault in a file, whose name is its `field`: `FileNotFoundError` and its kind for a file that cannot be read, else
/// `ValueError`.
pub(crate) fn in_file(py: Python<'_>, fault: &Fault) -> PyErr {
    let field = fault.file.display().to_string();
    match std::fs::metadata(&fault.file) {
        // Other faults name places that are no files, such as the command line.
        Err(error) if fault.what.starts_with("cannot read") => {
            // An `OSError` of two arguments becomes the subclass of its number.
            let arguments = (error.raw_os_error(), fault.to_string());
            with_attributes(py, PyOSError::new_err(arguments), &field, &fault.remedy)
        }
        _ => with_attributes(py, PyValueError::new_err(fault.to_string()), &field, &fault.remedy),
    }
}

/// The exception of several faults in files, one a line.
pub(crate) fn of_faults(py: Python<'_>, faults: &[Fault]) -> PyErr {
    match faults {
        [fault] => in_file(py, fault),
        _ => {
            let lines: Vec<String> = faults.iter().map(ToString::to_string).collect();
            let (field, remedy) = faults
                .first()
                .map_or_else(Default::default, |fault| (fault.file.display().to_string(), fault.remedy.clone()));
            with_attributes(py, PyValueError::new_err(lines.join("\n")), &field, &remedy)
        }
    }
}
