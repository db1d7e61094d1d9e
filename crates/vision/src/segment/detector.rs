//! Detectors of straight segments.

use nalgebra::Vector2;
use seafix_geometry::Pinhole;

use crate::{image::Image, workspace::Workspace};

/// A detected straight edge, as the undistorted directions (X/Z, Y/Z) of its ends.
///
/// The brighter side lies along (−d_y, d_x) of the direction d from the first end to the second: the same side as the
/// image's v axis for an edge along its u axis. Lens distortion bends the edge in the image, not its directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// The directions of the ends.
    pub ends: [Vector2<f64>; 2],
    /// The logarithm to base 10 of the number of false alarms; smaller is more certain.
    pub log_nfa: f64,
}

/// A detector of straight segments in one image.
pub trait SegmentDetector: Send + Sync + std::fmt::Debug {
    /// Replaces `found` by the segments of `image`, taken by `camera`.
    ///
    /// The ends need only be accurate to a pixel or two; a fit over the complete length follows.
    fn detect_into(&self, image: &Image, camera: &Pinhole, work: &mut Workspace, found: &mut Vec<Segment>);

    /// The segments of one image.
    fn detect(&self, image: &Image, camera: &Pinhole) -> Vec<Segment> {
        let mut found = Vec::new();
        self.detect_into(image, camera, &mut Workspace::default(), &mut found);
        found
    }
}
