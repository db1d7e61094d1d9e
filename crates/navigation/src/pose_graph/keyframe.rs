//! A stereo pair reduced to what recognition needs.

use seafix_geometry::{Camera, MeasuredPoint, Point, UncertainPoint};
use seafix_vision::{Descriptors, Keypoint};

/// What one pair shows now: measured points, and what their surroundings look like.
#[derive(Debug, Clone)]
pub struct StereoFeatures {
    /// When it was taken (ns).
    pub stamp_ns: u64,
    /// Its points, each seen by both cameras.
    pub cloud: Vec<MeasuredPoint>,
    /// Where the left image shows them, in the same order.
    pub keypoints: Vec<Keypoint>,
    /// What is around them there, in the same order.
    pub descriptors: Descriptors,
}

/// What is kept of a pair: points in the frame of its left camera, and what their surroundings look like.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFrame {
    /// Its points with their covariance.
    pub points: Vec<UncertainPoint<Camera>>,
    /// Where the left image showed them, in the same order.
    pub keypoints: Vec<Keypoint>,
    /// What was around them there, in the same order.
    pub descriptors: Descriptors,
}

impl StereoFeatures {
    /// What is worth keeping of it.
    pub fn reduced(&self) -> KeyFrame {
        KeyFrame {
            points: self.cloud.iter().map(|point| point.position).collect(),
            keypoints: self.keypoints.clone(),
            descriptors: self.descriptors.clone(),
        }
    }

    /// Where its points are.
    pub fn places(&self) -> Vec<Point<Camera>> {
        self.cloud.iter().map(|point| point.position.at).collect()
    }
}

impl KeyFrame {
    /// Where its points are.
    pub fn places(&self) -> Vec<Point<Camera>> {
        self.points.iter().map(|point| point.at).collect()
    }
}
