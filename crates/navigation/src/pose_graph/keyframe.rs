//! A stereo pair, reduced to the data of place recognition.

use seafix_geometry::{Camera, MeasuredPoint, Point, UncertainPoint};
use seafix_vision::{Descriptors, Keypoint};

/// The measured points of a stereo pair, with their descriptors.
#[derive(Debug, Clone)]
pub struct StereoFeatures {
    /// Time of exposure (ns).
    pub stamp_ns: u64,
    /// The points, each seen by both cameras.
    pub cloud: Vec<MeasuredPoint>,
    /// The key points of the left image, in the order of the points.
    pub keypoints: Vec<Keypoint>,
    /// The descriptors of the key points, in the same order.
    pub descriptors: Descriptors,
}

/// A key frame: points in the frame of its left camera, with their descriptors.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFrame {
    /// The points with their covariance.
    pub points: Vec<UncertainPoint<Camera>>,
    /// The key points of the left image, in the order of the points.
    pub keypoints: Vec<Keypoint>,
    /// The descriptors of the key points, in the same order.
    pub descriptors: Descriptors,
}

impl StereoFeatures {
    /// The key frame of this stereo pair.
    pub fn reduced(&self) -> KeyFrame {
        KeyFrame {
            points: self.cloud.iter().map(|point| point.position).collect(),
            keypoints: self.keypoints.clone(),
            descriptors: self.descriptors.clone(),
        }
    }

    /// The positions of its points.
    pub fn places(&self) -> Vec<Point<Camera>> {
        self.cloud.iter().map(|point| point.position.at).collect()
    }
}

impl KeyFrame {
    /// The positions of its points.
    pub fn places(&self) -> Vec<Point<Camera>> {
        self.points.iter().map(|point| point.at).collect()
    }
}
