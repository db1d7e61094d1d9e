//! Bounded readers of images, stereo rigs and data set descriptions.
//!
//! Every reader compares the sizes that a file declares with limits before it allocates memory. A file that cannot be
//! read is one [`Fault`](seafix_component::Fault) with file, line, value and remedy.

pub mod dataset;
pub mod image;
mod rig;

pub use image::{ImageLimits, read_image};
pub use rig::Rig;
