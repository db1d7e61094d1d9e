//! Matchers: which key point of the right image is which of the left.

mod epipolar;
mod mutual_ratio;
mod nearest;
mod support;

pub use mutual_ratio::MutualRatio;
use seafix_component::{Registry, entry};
use seafix_geometry::StereoRig;

use crate::{Descriptors, Image, Keypoint};

/// One image and what was found in it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The image.
    pub image: &'a Image,
    /// Its key points.
    pub keypoints: &'a [Keypoint],
    /// Their descriptors, in the same order.
    pub descriptors: &'a Descriptors,
}

/// Two key points that look like the same thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Index among the left key points.
    pub left: usize,
    /// Index among the right key points.
    pub right: usize,
    /// How unlike they are, in the matcher's own measure; smaller is more alike.
    pub distance: f32,
}

/// Pairs the key points of two views; no key point is in two pairs.
pub trait Matcher: Send + Sync + std::fmt::Debug {
    /// The pairs, in the order of the left key points.
    fn matches(&self, left: &View<'_>, right: &View<'_>, rig: &StereoRig) -> Vec<Match>;
}

/// All matchers.
pub static MATCHERS: Registry<dyn Matcher> = Registry::new("matcher", &[entry!(MutualRatio)]);
