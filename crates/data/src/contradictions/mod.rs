//! Contradictions between poses, images, rig and site, and the known mistakes that explain them.

mod pixels;
mod poses;

pub(crate) use pixels::{images_fault, mosaic_fault, residual};
pub(crate) use poses::{View, poses_faults, scale_fault};
