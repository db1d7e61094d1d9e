//! Contradictions between poses, images, rig and site, and the known mistakes that explain them.

mod evidence;
mod fixes;
#[cfg(test)]
mod margins;
mod motion;
mod pixels;
mod poses;
mod rig_mistakes;
mod trajectories;

pub(crate) use evidence::MeasuredPair;
pub(crate) use fixes::fixes_fault;
pub(crate) use motion::motion_fault;
pub(crate) use pixels::{dim_fault, images_fault, mosaic_fault, residual};
pub(crate) use poses::{View, poses_faults, scale_fault};
pub use trajectories::trajectory_fault;
