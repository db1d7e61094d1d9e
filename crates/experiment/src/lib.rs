//! Experiments: from a question in TOML to results, logs and a manifest.
//!
//! An [`Experiment`] states a question and the settings that vary. A [`Plan`] resolves it into trials. [`run`] opens
//! the [`Source`](seafix_data::source::Source)s, processes every frame with each trial's
//! [`Pipeline`](seafix::Pipeline), compares the result with the ground truth if there is one, and writes the log. Only
//! `judge.rs` sees both results and ground truth, after the pipeline has finished.

mod diff;
mod experiment;
mod git;
mod inspect;
mod judge;
mod keyframes;
mod log_decimation;
mod logging;
mod navigation;
mod odometry_fault;
mod parse;
mod pictures;
mod range;
mod record;
mod replay;
mod results;
mod run;
mod sweep;

pub use diff::{Change, Difference, diff};
pub use experiment::{Experiment, Plan, Trial};
pub use logging::{ImagesLogged, Logging};
pub use navigation::Navigation;
pub use odometry_fault::OdometryFault;
pub use range::{Number, Range};
pub use replay::{Replay, ReplayFrom};
pub use run::{
    Existing, Finished, Observer, Options, Remade, RunError, RunEstimate, SHARED, Shard, SharedPart, Silent,
    changed_outputs, check_run, components, estimate, is_run, kept_identity, merge, remake, run,
};
pub use sweep::{Axis, AxisValue, Case, changed, changed_pipeline};
