//! The Python package of Seafix: problems and answers, registration, localizers, logs and runs.
//!
//! Every function releases the interpreter's lock while it computes. Invalid input raises `ValueError` with the field
//! and the remedy; a panic becomes a `RuntimeError`.

mod answer;
mod array;
mod choice;
mod edges;
mod failure;
mod image;
mod integrity;
mod interpreter;
mod invalid;
mod laws;
mod listing;
mod localizer;
mod log;
mod odometry;
mod own;
mod own_detector;
mod own_search;
mod own_solver;
mod prior;
mod problem;
mod register;
mod rig;
mod run;
mod solve;
mod statistics;

#[pyo3::pymodule]
mod _seafix {
    #[pymodule_export]
    use crate::{
        answer::{Answer, Pose},
        integrity::Integrity,
        invalid::DegenerateError,
        laws::{search_laws, solver_laws},
        listing::{describe, detectors, searches, solvers},
        localizer::Localizer,
        log::{Frame, Log, TargetResult, read_axes, read_log},
        odometry::{Motion, Odometry},
        own_detector::{add_detector, detect},
        own_search::{SearchProblem, add_search},
        own_solver::add_solver,
        prior::{BoxPrior, PosePrior},
        problem::Problem,
        register::register,
        rig::{Rig, Site},
        run::{merge_runs, run_experiment},
        solve::solve,
        statistics::median_interval,
    };

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name is Python's")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
