//! Experiments: from a question in TOML to logs, results and a manifest.
//!
//! An [`Experiment`] asks one English question and says what varies. A [`Plan`] resolves it into
//! trials; [`run`] opens the [`Source`](source::Source)s, leads every frame through each trial's
//! [`Pipeline`], compares with truth where there is truth, and logs it all. Methods and truth meet
//! in one file, `judge.rs`, after the method has answered.

pub mod dataset;
mod diff;
mod exact;
mod experiment;
mod explore;
mod identity;
mod inspect;
mod joint;
mod judge;
mod logging;
mod manifest;
mod model;
mod navigate;
mod odometry_fault;
mod odometry_session;
mod pictures;
mod pipeline;
mod range;
mod read;
mod record;
mod replay;
mod results;
mod ros;
mod run;
pub mod source;
mod stages;
mod thin;
pub mod trajectory;
mod vary;

pub use diff::{Change, Difference, diff};
pub use experiment::{Experiment, Plan, Trial};
pub use explore::Keyframes;
pub use identity::{SHARED, Shared, components};
pub use logging::{ImagesLogged, Logging};
pub use manifest::{changed_outputs, check_run, is_run, kept_identity};
pub use model::{HandModel, HandPoint, Mark, ModelByHand};
pub use navigate::{Helm, Navigation};
pub use odometry_fault::OdometryFault;
pub use pipeline::{Pipeline, PipelineError};
pub use range::{Number, Range};
pub use replay::{Replay, ReplayFrom};
pub use results::COLUMNS;
pub use run::{
    Estimate, Existing, Finished, Observer, Options, Remade, RunError, Shard, Silent, estimate, merge, remake, run,
};
pub use seafix_component::read_text;
pub use stages::{Attempt, Sighting, Stages};
pub use vary::{Axis, Case, Place, changed};
