//! Readers of files from outside: images, stereo rigs and data set descriptions.
//!
//! Every reader is bounded: it holds the sizes that a file declares against limits before it
//! allocates anything. A file that cannot be read is one [`Fault`](seafix_component::Fault) with
//! file, place, value and remedy.

pub mod dataset;
pub mod image;
mod rig;

pub use image::{ImageLimits, read_image};
pub use rig::Rig;
