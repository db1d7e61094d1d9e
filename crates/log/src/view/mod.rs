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
//! - camera frames are optical: x right, y down, z forward, as the house's.
//! - annotations count pixels from the corner of the first one, so they add 0.5.
//! - clouds are 32-bit floats.

mod annotations;
mod calibration;
mod clouds;
mod image;
mod rigid;
mod scene;
mod tf;

use crate::proto::{Timestamp, foxglove::Color};

pub(crate) use annotations::annotations;
pub(crate) use calibration::calibrations;
pub(crate) use clouds::{candidate_cloud, identified_cloud, measured_cloud, model_cloud};
pub(crate) use image::compressed;
pub(crate) use rigid::Places;
pub(crate) use scene::model_scene;
pub(crate) use tf::{body_pose, fixed_transforms, moving_transforms};

/// Frame of the world: north, east, down.
const WORLD: &str = "world";
/// Frame of the site.
const SPS: &str = "sps";
/// The vehicle as estimated.
const AUV: &str = "auv";
/// The left and the right camera of the estimated vehicle; images and clouds live there.
const CAMERAS: [&str; 2] = ["camera_left", "camera_right"];
/// The vehicle as it really was.
const AUV_TRUTH: &str = "auv_truth";
/// The vehicle as roughly known before.
const AUV_PRIOR: &str = "auv_prior";

/// Frame of a target.
fn object_frame(id: &str) -> String {
    format!("object/{id}")
}

/// A stamp as the messages write it.
pub(crate) fn timestamp(stamp_ns: u64) -> Timestamp {
    let second = 1_000_000_000;
    let seconds = stamp_ns / second;
    // Viewers count seconds in 32 bits.
    if seconds > u64::from(u32::MAX) {
        return Timestamp { seconds: u32::MAX.into(), nanos: 999_999_999 };
    }
    Timestamp { seconds: seconds as i64, nanos: (stamp_ns % second) as i32 }
}

/// Colours that the colour-blind tell apart (Okabe and Ito, 2008), one a target in turn.
const PALETTE: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// The colour of target `index`.
fn colour(index: usize) -> [u8; 3] {
    PALETTE[index % PALETTE.len()]
}

/// The same as a message.
fn colour_message([r, g, b]: [u8; 3]) -> Color {
    let part = |byte: u8| f64::from(byte) / 255.0;
    Color { r: part(r), g: part(g), b: part(b), a: 1.0 }
}
