//! The record of a run: topics, messages and the MCAP file that holds them.
//!
//! One trial is one file. An experiment fills plain records ([`TrialHeader`], [`FrameRecord`]) and hands
//! them to a [`Writer`]; [`read`] gives the same records back, bit for bit. Inside the file every
//! record stands twice: exactly, in this project's own messages (`seafix.v2.*`, `proto/seafix`), and
//! drawn, in the well-known messages that Foxglove and Rerun display.
//!
//! ```
//! # fn record(path: &std::path::Path, header: &seafix_log::TrialHeader, frames: &[seafix_log::FrameRecord])
//! # -> Result<(), seafix_log::LogError> {
//! let mut writer = seafix_log::Writer::create(path, header)?;
//! for frame in frames {
//!     writer.frame(frame)?;
//! }
//! writer.finish()?; // a writer dropped before leaves `NAME.mcap.partial`
//! assert_eq!(seafix_log::read(path)?.frames, frames);
//! # Ok(())
//! # }
//! ```
//!
//! # Topics
//!
//! | topic | message | |
//! |---|---|---|
//! | `/run/header` | `seafix.v2.TrialHeader` | once, before all else |
//! | `/referencing/candidates` | `seafix.v2.Candidates` | one an attempted target and frame |
//! | `/referencing/result` | `seafix.v2.ReferencingResult` | likewise |
//! | `/metrics/evaluation` | `seafix.v2.Evaluation` | likewise: comparison with truth |
//! | `/metrics/inspection` | `seafix.v2.Inspection` | one a frame with a point of interest in view: where the vehicle had it, and where it is |
//! | `/metrics/timing` | `seafix.v2.Timing` | one a frame |
//! | `/metrics/totals` | `seafix.v2.Totals` | once, last: what all frames add up to, logged or not |
//! | `/referencing/inputs` | `seafix.v2.Inputs` | one a frame: what the method was given, to the last bit |
//! | `/referencing/frame` | `seafix.v2.Frame` | one a frame, its last: cloud, key points, prior, truth, navigation |
//! | `/camera/left/image`, `/camera/right/image` | `foxglove.CompressedImage` | PNG, lossless; the only copy of the images |
//! | `/camera/left/calibration`, `/camera/right/calibration` | `foxglove.CameraCalibration` | once |
//! | `/camera/left/annotations`, `/camera/right/annotations` | `foxglove.ImageAnnotations` | key points, candidates, identified points |
//! | `/tf` | `foxglove.FrameTransforms` | the tree of frames |
//! | `/cloud`, `/cloud/candidates`, `/cloud/identified` | `foxglove.PointCloud` | coloured by target |
//! | `/model`, `/scene/model` | `foxglove.PointCloud`, `foxglove.SceneUpdate` | once: the feature points |
//! | `/pose/estimate`, `/pose/truth`, `/pose/prior` | `foxglove.PoseInFrame` | the vehicle |
//!
//! Attachments `configuration.toml` and `site.toml`; metadata record `run`, and `recovered` in what [`recover`] saved of a
//! log that was not whole.
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
mod frames;
mod join;
mod png;
mod proto;
pub mod quantities;
mod read;
mod record;
mod recording;
mod recover;
mod topic;
mod view;
mod write;

pub use error::LogError;
pub use frames::Frames;
pub use join::{join, join_lacking};
pub use png::{encode_png, encode_png_16};
pub use read::{Reader, TrialLog, looks_like, read};
pub use record::{
    Alternative, AnswerRecord, Axis, CameraRecord, CloudPoint, Component, ELSEWHERE, Evaluation, ExactPose,
    FrameRecord, FrameTimes, GreyImage, Inputs, Integrity, Matrix3, Matrix4, Matrix6, ModelPoint, NavigatedRecord,
    NavigationErrors, NavigationRecord, OdometryStep, Outcome, Pair, PixelPair, PointOfInterest, PriorRecord,
    ProblemRecord, Region, RigRecord, SensorReading, SharedStages, SitePoint, TargetModel, TargetRecord, TargetTimes,
    Totals, TrialHeader, TrueState, TruthRecord, VisiblePoint,
};
pub use recording::{Entry, Recording, Topic};
pub use recover::{Recovered, recover};
pub use write::Writer;
