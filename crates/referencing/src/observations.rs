//! What a solver is given.

use seafix_geometry::{Camera, Object, Point, StereoPixels, StereoRig, UncertainPoint};

/// One identified point: where it was measured and where the model has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Measured, camera frame.
    pub measured: UncertainPoint<Camera>,
    /// Where the two images show it, if it came from images.
    pub pixels: Option<StereoPixels>,
    /// The model's place.
    pub model: Point<Object>,
    /// Standard deviation of each coordinate of the model's place (m).
    pub model_sigma: f64,
}

/// All identified points of one target, and the rig that saw them if there is one.
#[derive(Debug, Clone)]
pub struct Observations<'a> {
    /// The points, in the order of the model.
    pub points: Vec<Observation>,
    /// The rig.
    pub rig: Option<&'a StereoRig>,
}
