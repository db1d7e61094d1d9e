//! Straight edges: measured lines, the edges of targets, and what was identified.

use super::matrix::Matrix4;

/// A straight edge measured by both cameras, frame of the left camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Two places on the line, as far apart as it was seen (m).
    pub ends: [[f64; 3]; 2],
    /// The covariance (m²) of the offsets of the first end along two directions across the line, and of the second end.
    pub covariance: Matrix4,
    /// Whether the rig measures the depth of the line; not of lines close to the epipolar planes.
    pub depth: bool,
    /// The segments in the left and the right image; `None` for a line that does not come from images.
    pub segments: Option<[[Offset; 2]; 2]>,
}

/// The offset of a straight image edge across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// The place on the fitted edge (u, v), in pixels.
    pub at: [f64; 2],
    /// The unit normal of the edge in the image.
    pub normal: [f64; 2],
    /// The standard deviation of the offset (px), all causes together.
    pub sigma: f64,
    /// The part of it that the scene adds at this place, in both images (px).
    pub texture: f64,
    /// The part that all four offsets of a line have in common (px).
    pub common: f64,
}

/// A straight edge of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEdge {
    /// Its id.
    pub id: String,
    /// Its ends, object frame (m).
    pub ends: [[f64; 3]; 2],
}

/// An edge of the target and the line believed to be it, by their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EdgePair {
    /// Index into the target's edges.
    pub model: u32,
    /// Index into the frame's lines.
    pub line: u32,
}
