//! Data sets: folders with stereo pairs, their rig, truth and prior. The native format is `seafix-dataset/1`; EuRoC and
//! KITTI are read directly.

mod check;
mod euroc;
mod folder;
mod foreign;
mod kitti;
mod open;
mod pairing;
mod png;
mod ports;
pub mod tables;
pub mod tum;
mod write;

pub use check::{INSPECTED_PAIRS, hash_faults, hex, input_hashes, inspect_images, sha256, swapped};
pub use check::{
    are_identical, check, identical_images_fault, partners_remedy, right_camera_rotation, strangers, swap_fault,
    swapped_at_first,
};
pub use kitti::Cameras;
pub use open::{Dataset, DatasetFrame, is_one};
pub use pairing::{SAME_INSTANT_NS, left_out, pairs};
pub use png::{grey, write_png};
pub use ports::CalibratedPort;
pub use write::write;
