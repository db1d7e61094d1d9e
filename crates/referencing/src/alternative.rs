//! Alternative poses, and the distance between two poses.

use seafix_geometry::{Camera, Object, Transform};

use crate::problem::Correspondence;

/// An alternative pose that explains the data nearly as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The camera's pose in the object frame.
    pub object_from_camera: Transform<Object, Camera>,
    /// The pairs that support the pose.
    pub pairs: Vec<Correspondence>,
    /// The edges that support the pose.
    pub edges: Vec<Correspondence>,
    /// The score of the pose, defined as `Fix::score`.
    pub score: f64,
}
