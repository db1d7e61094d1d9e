//! Key points.

use seafix_geometry::Pixel;

/// A key point: a pixel that can be detected again in another image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keypoint {
    /// The position (px), with subpixel resolution.
    pub at: Pixel,
    /// The strength in the detector's own measure; larger is stronger.
    pub response: f32,
    /// The size of the structure (px): the standard deviation of the Gaussian of its detection.
    pub scale: f32,
}
