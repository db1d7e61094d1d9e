//! `seafix-dataset/1`: a folder with stereo pairs, their rig, and what is known about them.

mod check;
mod describe;
mod encoded;
mod folder;
mod open;
mod picture;
mod tables;
pub mod tum;
mod write;

pub use check::{check, swapped_at_first, swapped_fault};
pub(crate) use check::{hash_faults, input_hashes, sha256, swapped};
pub use open::{Dataset, DatasetFrame, read_rig};
pub use picture::{ImageLimits, read_image, write_png};
pub use write::write;
