//! Experiments: from a question in TOML to results, logs and a manifest.
//!
//! An [`Experiment`] states a question and the settings that vary. A [`Plan`] resolves it into trials. [`run`] opens
//! the [`Source`](seafix_data::source::Source)s, processes every frame with each trial's
//! [`PipelineSettings`](seafix::PipelineSettings), compares the result with the ground truth if there is one, and writes the log. Only
//! `judge.rs` sees both results and ground truth, after the pipeline has finished.
//!
//! ```
//! use seafix_experiment::Plan;
//!
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/virtual-direct.toml");
//! let settings = ["source.frames=2".to_owned(), "pipeline.search=\"ransac\"".to_owned()]; // as `--set` on the command line
//! let plan = Plan::read(file.as_ref(), &settings).expect("a valid experiment");
//! println!("{} trials, the first is {}", plan.trials.len(), plan.trials[0].name);
//!
//! let faults = Plan::read(file.as_ref(), &["source.frames=-2".to_owned()]).unwrap_err();
//! println!("{}", faults[0]); // place, value and remedy
//! ```

mod diff;
mod events;
mod experiment;
mod git;
mod inspect;
mod judge;
mod keyframes;
mod log_decimation;
mod logging;
mod navigation;
mod not_attempted;
mod odometry_fault;
mod parse;
mod pictures;
mod published;
mod range;
mod record;
mod replay;
mod results;
mod run;
mod settings;
mod sweep;
mod true_edges;

pub use diff::{Change, Difference, diff};
pub use experiment::{Experiment, Plan, Trial};
pub use logging::{ImagesLogged, Logging};
pub use navigation::Navigation;
pub use odometry_fault::OdometryFault;
pub use published::Published;
pub use range::{Number, Range};
pub use replay::{Replay, ReplayFrom};
pub use run::{
    Existing, Finished, Observer, Options, Remade, RunError, RunEstimate, SHARED, Shard, SharedPart, Silent,
    changed_outputs, check_run, components, estimate, inputs, is_run, kept_identity, merge, remake, run,
};
pub use settings::experiment_settings;
pub use sweep::{Axis, AxisValue, Case, changed, changed_pipeline};
