//! ROS 2 messages of recordings: five types, decoded without ROS.
//!
//! A message is little-endian CDR after a header of four bytes. Every number is aligned to its size, counted from the
//! end of the header. The schema in the recording, `ros2msg` or `ros2idl`, is compared with the supported definition.

mod cdr;
mod definition;
mod idl;
mod messages;
mod rig;
mod samples;
mod tf;
mod uncertainty;

pub(crate) use definition::{differs, plain};
pub(crate) use messages::{CameraInfo, CompressedImage, Image, Odometry, stamp, transforms};
pub use rig::Views;
pub(crate) use rig::{camera, contradiction, right_from_left};
pub(crate) use tf::Tree;
pub(crate) use uncertainty::covariance;
