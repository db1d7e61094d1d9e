//! Data sets: folders with stereo pairs, their rig, and what is known about them. Our own are `seafix-dataset/1`; those
//! of EuRoC and KITTI are read as they are.

mod check;
mod decode;
mod describe;
mod encoded;
mod euroc;
mod folder;
mod foreign;
mod kitti;
mod open;
mod pairing;
mod picture;
mod pnm;
pub(crate) mod tables;
pub mod tum;
mod write;

pub(crate) use check::{LOOKED_AT, hash_faults, hex, input_hashes, look_through, sha256, swapped};
pub use check::{
    are_twins, check, partners_remedy, realigned, strangers, swapped_at_first, swapped_fault, twins_fault,
};
pub use kitti::Cameras;
pub use open::{Dataset, DatasetFrame, DescribedRig, is_one, read_rig};
pub(crate) use pairing::{SAME_INSTANT_NS, left_out, pairs};
pub use picture::{ImageLimits, read_image, write_png};
pub(crate) use picture::{decode_image, image_of_samples};
pub use write::write;
