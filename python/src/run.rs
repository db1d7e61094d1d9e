//! Runs of experiments.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{
    exceptions::{PyOSError, PyRuntimeError, PyUserWarning, PyValueError},
    prelude::*,
};
use seafix_component::Fault;
use seafix_experiment::{Existing, Finished, Observer, Options, Plan, RunError, Shard, merge as merge_shards, run};

use crate::{
    failure,
    interpreter::panicked,
    invalid::{invalid, of_faults, stated},
    log::of_log,
};

/// The interval between two looks for signals and two reports of progress.
const LOOK: Duration = Duration::from_millis(100);

/// The state of a run, shared by its threads and the one that waits.
#[derive(Default)]
struct Watch {
    stop: AtomicBool,
    total: AtomicUsize,
    done: AtomicUsize,
    warnings: Mutex<Vec<String>>,
}

impl Watch {
    /// Raises the warnings that were reported since the last call.
    fn raise_warnings(&self, py: Python<'_>) -> PyResult<()> {
        let new = std::mem::take(&mut *self.warnings.lock().unwrap_or_else(PoisonError::into_inner));
        let category = py.get_type::<PyUserWarning>();
        new.iter().try_for_each(|text| py.import("warnings")?.call_method1("warn", (text, &category)).map(drop))
    }
}

impl Observer for Watch {
    fn begins(&self, frames: usize, _bytes: u64, _folder: &Path) {
        self.total.store(frames, Ordering::Relaxed);
    }

    fn resumes(&self, frames: usize) {
        self.done.fetch_add(frames, Ordering::Relaxed);
    }

    fn warns(&self, warning: &Fault) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(warning.to_string());
    }

    fn frame(&self, _trial: &str) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || failure::failed()
    }
}

/// Run an experiment into a folder.
///
/// Parameters
/// ----------
/// experiment : path
///     An experiment file, or the folder of a data set.
/// out : path or None
///     The folder of the run.
/// threads : int
///     Number of threads.
/// settings : list of str
///     Changed settings, ``key=value``.
/// existing : str
///     ``refuse``, ``resume`` or ``overwrite``.
/// shard : str or None
///     ``k/n``.
/// timed : bool
///     Whether durations are logged.
/// progress : callable or None
///     ``progress(done, total)``, called every tenth of a second.
///
/// Returns
/// -------
/// (str, int)
///     The folder and the number of rows.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are the options of a run, named in Python")]
pub(crate) fn run_experiment(
    py: Python<'_>,
    experiment: PathBuf,
    out: Option<PathBuf>,
    threads: usize,
    settings: Vec<String>,
    existing: &str,
    shard: Option<&str>,
    timed: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(PathBuf, usize)> {
    let shard: Option<Shard> =
        shard.map(|text| text.parse().map_err(|error: String| stated(py, "shard", &error))).transpose()?;
    let options = Options { out, existing: of_name(py, existing)?, threads, shard, timed, separate: false };
    watched(py, progress, move |watch| {
        let plan = Plan::read(&experiment, &settings).map_err(Stopped::Plan)?;
        run(&plan, &options, watch).map_err(Stopped::Run)
    })
}

/// Merge the shards of a run.
///
/// Parameters
/// ----------
/// folders : list of path
///     The folders of the shards.
/// out : path
///     The folder of the run.
/// threads : int
///     Number of threads.
/// existing : str
///     ``refuse``, ``resume`` or ``overwrite``.
///
/// Returns
/// -------
/// (str, int)
///     The folder and the number of rows.
#[pyfunction]
pub(crate) fn merge_runs(
    py: Python<'_>,
    folders: Vec<PathBuf>,
    out: PathBuf,
    threads: usize,
    existing: &str,
) -> PyResult<(PathBuf, usize)> {
    let options = Options { threads, existing: of_name(py, existing)?, ..Options::into(out) };
    watched(py, None, move |watch| merge_shards(&folders, &options, watch).map_err(Stopped::Run))
}

fn of_name(py: Python<'_>, existing: &str) -> PyResult<Existing> {
    match existing {
        "refuse" => Ok(Existing::Refuse),
        "resume" => Ok(Existing::Resume),
        "overwrite" => Ok(Existing::Overwrite),
        _ => Err(invalid(py, "existing", format!("`existing` is {existing:?}"), "give refuse, resume or overwrite")),
    }
}

/// The reason why a run did not finish.
enum Stopped {
    Plan(Vec<Fault>),
    Run(RunError),
}

/// The result of a run on a thread of its own; this thread reports progress and looks for signals.
///
/// After a signal each thread of the run finishes its frame, so that the run can be resumed.
fn watched(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<Finished, Stopped> + Send + 'static,
) -> PyResult<(PathBuf, usize)> {
    drop(failure::taken_of_any());
    let watch = Arc::new(Watch::default());
    let (sender, mut receiver) = channel();
    let own = Arc::clone(&watch);
    let spawned = thread::Builder::new().name("seafix-run".to_owned()).spawn(move || {
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(&own)));
        // The receiver lives until the result is there.
        let _ = sender.send(result);
    });
    spawned.map_err(|error| PyOSError::new_err(format!("cannot start a thread: {error}; end other programs")))?;
    let mut raised: Option<PyErr> = None;
    let result = loop {
        let waited = py.detach(move || {
            let result = receiver.recv_timeout(LOOK);
            (receiver, result)
        });
        receiver = waited.0;
        let report = || match progress {
            Some(call) => {
                let (done, total) = (watch.done.load(Ordering::Relaxed), watch.total.load(Ordering::Relaxed));
                call.call1((done, total)).map(drop)
            }
            None => Ok(()),
        };
        match waited.1 {
            Ok(result) => break result,
            Err(RecvTimeoutError::Disconnected) => return Err(PyRuntimeError::new_err("the thread of the run ended")),
            Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = py.check_signals().and_then(|()| report()) {
                    watch.stop.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
        }
    };
    if let Some(error) = raised.or_else(failure::taken_of_any) {
        return Err(error);
    }
    watch.raise_warnings(py)?;
    match result.map_err(panicked)? {
        Ok(finished) => {
            if let Some(call) = progress {
                call.call1((watch.done.load(Ordering::Relaxed), watch.total.load(Ordering::Relaxed)))?;
            }
            Ok((finished.folder, finished.rows))
        }
        Err(Stopped::Plan(faults) | Stopped::Run(RunError::Input(faults))) => Err(of_faults(py, &faults)),
        Err(Stopped::Run(RunError::Log(error))) => Err(of_log(py, &error)),
        Err(Stopped::Run(error @ RunError::Output(_))) => Err(PyOSError::new_err(in_python(&error.to_string()))),
        Err(Stopped::Run(error @ RunError::Interrupted(_))) => {
            Err(PyValueError::new_err(in_python(&error.to_string())))
        }
    }
}

/// A message of the runner with the arguments of Python in place of the options of the command line.
fn in_python(message: &str) -> String {
    let options = [("--out", "`out`"), ("--resume", "existing=\"resume\""), ("--overwrite", "existing=\"overwrite\"")];
    options.iter().fold(message.to_owned(), |text, (option, argument)| text.replace(option, argument))
}
