//! ROS 2 messages of recordings, decoded without ROS.
//!
//! A message is little-endian CDR after a header of four bytes. Every number is aligned to its size, counted from the
//! end of the header. The schema in the recording, `ros2msg` or `ros2idl`, is compared with the supported definition.

mod bayer;
mod cdr;
mod definition;
mod idl;
mod messages;
mod rig;
mod samples;
mod tf;
mod uncertainty;

pub(crate) use bayer::Mosaic;
pub(crate) use definition::{differs, plain};
pub(crate) use messages::{CameraInfo, CompressedImage, Image, POSES, PoseMessage, stamp, transforms};
pub use rig::Views;
pub(crate) use rig::{camera, contradiction, is_uncalibrated, is_without_raw_model, right_from_left};
pub(crate) use tf::Tree;
pub(crate) use uncertainty::covariance;
