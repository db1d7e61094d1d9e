//! The motion of the vehicle from image to image.
//!
//! [`Odometry`] follows a stereo rig from pair to pair; what it finds is a [`Journey`]: segments of poses relative to
//! the first camera, and what became of every pair. Where it cannot say how the rig moved it says so ([`Lost`]) instead
//! of inventing a motion. A [`Standing`] carries a fix along its steps. This crate knows no truth.

mod chain;
mod journey;
mod odometry;
mod stereo;

pub use chain::{Standing, by_world};
pub use journey::{Journey, Local, Lost, Outcome, Segment, Side, Waypoint};
pub use odometry::{NotAfter, ODOMETRIES, Odometry, Reckoning, StereoPair};
pub use stereo::Stereo;
