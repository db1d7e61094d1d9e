//! Work without the interpreter's lock: panics become exceptions, and Ctrl-C ends the wait.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{
    exceptions::{PyOSError, PyRuntimeError},
    prelude::*,
};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The interval between two looks for signals; a tenth of a second is felt as immediate.
const LOOK: Duration = Duration::from_millis(50);

/// The result of work that ends soon, on this thread, with the interpreter's lock released.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(work))).map_err(panicked)
}

/// The threads of this process for long work.
///
/// A forked process has none of its parent's threads, so that work on them would wait forever: it gets a pool of its own.
fn pool() -> PyResult<Arc<ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = &*pool
        && *owner == process
    {
        return Ok(Arc::clone(pool));
    }
    let made = ThreadPoolBuilder::new().build();
    let made = Arc::new(
        made.map_err(|error| PyOSError::new_err(format!("cannot start threads: {error}; end other programs")))?,
    );
    // The parent's pool waits for threads that are not here.
    std::mem::forget(pool.replace((process, Arc::clone(&made))));
    Ok(made)
}

/// The result of work that may take long, on threads of its own; this thread looks for signals.
///
/// A signal whose handler raises, such as Ctrl-C, raises at once. Work that cannot be stopped ends by itself, and its
/// result is dropped.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let pool = pool()?;
    let spawned = thread::Builder::new().name("seafix".to_owned()).spawn(move || {
        // The receiver is gone after an interruption.
        let _ = sender.send(catch_unwind(AssertUnwindSafe(|| pool.install(work))));
    });
    spawned.map_err(|error| PyOSError::new_err(format!("cannot start a thread: {error}; end other programs")))?;
    loop {
        let waited = py.detach(move || {
            let result = receiver.recv_timeout(LOOK);
            (receiver, result)
        });
        receiver = waited.0;
        match waited.1 {
            Ok(result) => return result.map_err(panicked),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => return Err(panicked(Box::new("the thread ended"))),
        }
    }
}

/// The exception for a panic.
pub(crate) fn panicked(panic: Box<dyn Any + Send>) -> PyErr {
    PyRuntimeError::new_err(format!("internal error of Seafix: {}; report it with the input", text_of(&*panic)))
}

/// The message of a panic.
pub(crate) fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("a panic without a message")
}
