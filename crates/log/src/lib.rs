//! The record of a run: topics, messages and the MCAP file that holds them.
//!
//! One trial is one file. An experiment passes plain records ([`TrialHeader`], [`FrameRecord`]) to a [`Writer`];
//! [`read`] returns the same records, bit for bit. The file holds every record in two forms: the exact values, in this
//! project's own messages (`seafix.v2.*`, `proto/seafix`), and a view of them in standard messages that Foxglove and
//! Rerun display.
//!
//! ```
//! use seafix_log::{FrameRecord, LogError, TrialHeader, Writer};
//!
//! fn record(path: &std::path::Path, header: &TrialHeader, frames: &[FrameRecord]) -> Result<(), LogError> {
//!     let mut writer = Writer::create(path, header)?;
//!     for frame in frames {
//!         writer.frame(frame)?;
//!     }
//!     writer.finish()?; // without it the file keeps its name `NAME.mcap.partial`
//!     assert_eq!(seafix_log::read(path)?.frames, frames);
//!     Ok(())
//! }
//!
//! let error = seafix_log::read("missing.mcap".as_ref()).unwrap_err();
//! assert!(error.to_string().contains("missing.mcap"));
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
//! | `/metrics/inspection` | `seafix.v2.Inspection` | one a frame with a point of interest in view: its estimated and its true place |
//! | `/metrics/timing` | `seafix.v2.Timing` | one a frame |
//! | `/metrics/totals` | `seafix.v2.Totals` | once, last: the totals of all frames, logged or not |
//! | `/referencing/inputs` | `seafix.v2.Inputs` | one a frame: the inputs of the method, bit for bit |
//! | `/referencing/frame` | `seafix.v2.Frame` | one a frame, its last: cloud, key points, prior, truth, navigation |
//! | `/camera/left/image`, `/camera/right/image` | `foxglove.CompressedImage` | PNG, lossless; the only copy of the images |
//! | `/camera/left/calibration`, `/camera/right/calibration` | `foxglove.CameraCalibration` | once |
//! | `/camera/left/annotations`, `/camera/right/annotations` | `foxglove.ImageAnnotations` | key points, candidates, identified points |
//! | `/tf` | `foxglove.FrameTransforms` | the tree of frames |
//! | `/cloud`, `/cloud/candidates`, `/cloud/identified` | `foxglove.PointCloud` | coloured by target |
//! | `/model`, `/scene/model` | `foxglove.PointCloud`, `foxglove.SceneUpdate` | once: the feature points; the scene also has the straight edges |
//! | `/model/edges` | `foxglove.PointCloud` | once: the straight edges, as dots |
//! | `/cloud/lines`, `/cloud/gates`, `/pose/covariance` | `foxglove.PointCloud` | frames with images: measured lines, gates of the prior (99 %) and the 3σ ellipsoid of the position, as dots |
//! | `/path/estimate`, `/path/truth` | `foxglove.PointCloud` | frames with images: the vehicle as one dot a frame |
//! | `/pose/estimate`, `/pose/truth`, `/pose/prior` | `foxglove.PoseInFrame` | the vehicle |
//!
//! Attachments are `configuration.toml` and `site.toml`. The metadata record is `run`; a log that [`recover`] made from a
//! damaged one also has `recovered`.
//!
//! # Conventions
//!
//! - Records use metres, radians, column vectors (`p_a = a_from_b · p_b`), matrices by rows, and pixels with the centre
//!   of the first pixel at (0, 0). Only this crate's `view` module converts them to other conventions.
//! - `log_time` = `publish_time` = the stamp of the frame; stamps do not decrease.
//! - The same records give the same bytes. Durations differ from run to run; only `/metrics/timing` holds them, so
//!   all other messages can be compared.
//! - A file is written as `NAME.partial` and renamed when it is complete. A file that still ends in `.partial` was
//!   interrupted.

mod check;
mod chunk;
mod convert;
mod error;
mod frames;
mod join;
mod parse;
mod png;
mod proto;
pub mod quantities;
mod read;
mod record;
mod recording;
mod recover;
mod topic;
mod unchanged;
mod unpacked;
mod view;
mod write;

pub use error::LogError;
pub use frames::Frames;
pub use join::{join, join_lacking};
pub use png::{encode_png, encode_png_16};
pub use read::{Reader, TrialLog, looks_like, read};
pub use record::{
    Alternative, AnswerRecord, Axis, BestPose, CameraRecord, CloudPoint, Component, EdgePair, Evaluation, ExactPose,
    FrameRecord, FrameTimes, GreyImage, Inputs, Integrity, Line, Matrix3, Matrix4, Matrix6, ModelEdge, ModelPoint,
    NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep, Offset, Outcome, Pair, PixelPair,
    PointOfInterest, PriorRecord, ProblemEdge, ProblemRecord, Region, RigRecord, SensorReading, SharedStages,
    SitePoint, TargetModel, TargetRecord, TargetTimes, Totals, TrialHeader, TrueState, TruthRecord, VisiblePoint,
    displaced_event, displaced_object,
};
pub use recording::{Entry, Recording, Topic};
pub use recover::{Recovered, recover};
pub use unchanged::unchanged;
pub use write::Writer;
