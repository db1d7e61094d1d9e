//! Exceptions of components written in Python, kept until the call that uses the component ends.
//!
//! A component runs in the middle of the library's work, which has no exceptions. Its exception is kept here, the work
//! goes on with a rejection, and the caller raises the exception instead of using the result.

use std::{
    cell::RefCell,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use pyo3::PyErr;

thread_local! {
    static OWN: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// The first exception on a thread of a run, which has several.
static ANY: Mutex<Option<PyErr>> = Mutex::new(None);
static FAILED: AtomicBool = AtomicBool::new(false);

/// Keeps an exception of a component.
pub(crate) fn keep(py: pyo3::Python<'_>, error: PyErr) {
    let mut any = ANY.lock().unwrap_or_else(PoisonError::into_inner);
    any.get_or_insert_with(|| error.clone_ref(py));
    FAILED.store(true, Ordering::Relaxed);
    OWN.with(|own| {
        own.borrow_mut().get_or_insert(error);
    });
}

/// The first exception on this thread since the last call; `None` if there was none.
pub(crate) fn taken() -> Option<PyErr> {
    OWN.with(|own| own.borrow_mut().take())
}

/// Whether a component failed on any thread.
pub(crate) fn failed() -> bool {
    FAILED.load(Ordering::Relaxed)
}

/// The first exception on any thread since the last call.
pub(crate) fn taken_of_any() -> Option<PyErr> {
    FAILED.store(false, Ordering::Relaxed);
    ANY.lock().unwrap_or_else(PoisonError::into_inner).take()
}
