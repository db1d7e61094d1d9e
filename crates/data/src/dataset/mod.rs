//! Data sets: folders with stereo pairs, their rig, truth and prior. The native format is `seafix-dataset/1`; EuRoC and
//! KITTI are read directly.

mod check;
mod contents;
mod euroc;
mod folder;
mod foreign;
mod kitti;
mod names;
mod open;
mod pairing;
mod png;
mod tables;
pub mod tum;
mod write;

pub use check::{INSPECTED_PAIRS, hash_faults, hex, input_hashes, inspect_images, sha256, swapped};
pub use check::{
    are_identical, check, contradictions, identical_images_fault, partners_remedy, right_camera_rotation, strangers,
    swap_fault, swapped_at_first,
};
pub(crate) use check::{odd_times, rotation_of_sample, swap_of_first};
pub use contents::{Dataset, DatasetFrame};
pub use kitti::Cameras;
pub use open::is_one;
pub use pairing::{SAME_INSTANT_NS, clock_offset, constant_offset, left_out, pairs};
pub use png::{grey, write_png};
pub use write::write;

pub use crate::ports::CalibratedPort;
