//! ROS 2's messages, out of recordings: five types, decoded without ROS.
//!
//! A message is CDR, little end first, behind a header of four bytes; every number stands on a multiple of its size,
//! counted from behind the header. The schema beside it, `ros2msg` or `ros2idl`, is held against the definition that is
//! decoded.

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
