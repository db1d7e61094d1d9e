//! A point of the cloud: what the eyes hand to the method.

use crate::{Camera, StereoPixels, UncertainPoint};

/// One point that the stereo rig measured, not yet believed to be anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Where it is, and how well that is known.
    pub position: UncertainPoint<Camera>,
    /// Where the two images show it; absent when the cloud came as bare points.
    pub pixels: Option<StereoPixels>,
}
