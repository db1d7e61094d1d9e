//! The record of a run: topics, messages and the MCAP file that holds them.
//!
//! One trial is one file. An experiment fills plain records ([`TrialHeader`], [`FrameRecord`]) and hands
//! them to a [`Writer`]; [`read`] gives the same records back, bit for bit. Inside the file every
//! record stands twice: exactly, in this project's own messages (`seafix.v1.*`, `proto/seafix`), and
//! drawn, in the well-known messages that Foxglove and Rerun display.
//!
//! # Conventions
//!
//! - Records are in the conventions of the house: metres, radians, column vectors (`p_a = a_from_b · p_b`),
//!   matrices as rows, pixels with the centre of the first pixel at (0, 0). Foreign conventions begin
//!   in this crate's `view` module and nowhere else.
//! - `log_time` = `publish_time` = the stamp of the frame; stamps do not decrease.
//! - The same records give the same bytes. Durations differ from run to run, so they stand alone on
//!   `/metrics/timing`: everything else can be compared message by message.
//! - A file is written as `NAME.partial` and renamed when it is complete; what still carries
//!   `.partial` was interrupted.

mod check;
mod convert;
mod error;
mod png;
mod proto;
mod read;
mod record;
mod topic;
mod view;
mod write;

pub use error::LogError;
pub use read::{Reader, TrialLog, read};
pub use record::{
    Alternative, Axis, CameraRecord, CloudPoint, Component, Evaluation, FrameRecord, FrameTimes, GreyImage, Matrix3,
    Matrix4, Matrix6, ModelPoint, Outcome, Pair, PixelPair, PriorRecord, RigRecord, TargetModel, TargetRecord,
    TargetTimes, TrialHeader, TruthRecord, VisiblePoint,
};
pub use write::Writer;
