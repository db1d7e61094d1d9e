//! The records drawn in the well-known messages of Foxglove, which Rerun reads too.
//!
//! Foreign conventions, all of them here:
//! - frames: `world` (north, east, down; if a world is known) → `sps` (the site) → `object/ID`;
//!   `sps` → `auv` (estimate: forward, starboard, down) → `camera_left` → `camera_right`;
//!   `world` → `auv_truth` → `camera_left_truth`, `world` → `auv_prior`. One parent a child. A frame
//!   of the trial that gave no fix moves neither `auv` nor the cameras. A target whose place in the
//!   site is not known has a frame of its own, joined to nothing: its points stand in `/scene/model`,
//!   not in `/model`, and its fixes do not place the vehicle. `world_enu` and `auv_flu` are the same
//!   places with the axes of REP-103.
//! - camera frames are optical: x right, y down, z forward, the convention of Seafix.
//! - annotations count pixels from the corner of the first one, so they add 0.5.
//! - clouds are 32-bit floats.

mod annotations;
mod calibration;
mod clouds;
mod image;
mod names;
mod outlines;
mod rigid;
mod scene;
mod tf;
mod values;

pub(crate) use annotations::annotations;
pub(crate) use calibration::calibrations;
pub(crate) use clouds::{candidate_cloud, identified_cloud, measured_cloud, model_cloud};
pub(crate) use image::compressed;
pub(crate) use outlines::{gates, measured_lines, model_edges, path, position_covariance};
pub(crate) use rigid::Places;
pub(crate) use scene::model_scene;
pub(crate) use tf::{body_pose, fixed_transforms, moving_transforms};
