//! Matchers: which key point of the right image is which of the left.

mod along;
pub(crate) mod correlate;
mod curve;
mod epipolar;
mod epipolar_band;
mod exhaustive;
mod grid;
mod lucas_kanade;
mod metric;
mod mutual_ratio;
mod nearest;
mod sought;
mod support;
#[cfg(test)]
mod test_scene;
mod zncc_band;

pub use epipolar_band::EpipolarBand;
pub use lucas_kanade::LucasKanade;
pub use mutual_ratio::MutualRatio;
use seafix_component::{Registry, entry};
use seafix_geometry::{Pixel, StereoRig};
pub use zncc_band::ZnccBand;

use crate::{Descriptors, Image, Keypoint, Workspace};

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

/// A key point of the left image and the place in the right image that looks the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Index among the left key points.
    pub left: usize,
    /// The place in the right image: a key point's, or wherever the matcher found it.
    pub right: Pixel,
    /// How unlike they are, in the matcher's own measure; smaller is more alike.
    pub distance: f32,
}

/// Finds the key points of the left view again in the right one; no key point and no place is in two pairs.
pub trait Matcher: Send + Sync + std::fmt::Debug {
    /// Replaces `found` by the pairs, in the order of the left key points.
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    );

    /// Whether it compares descriptors; a matcher that looks at the images alone needs none to be made.
    fn compares_descriptors(&self) -> bool {
        true
    }

    /// The pairs of two views, in the order of the left key points.
    fn matches(&self, left: &View<'_>, right: &View<'_>, rig: &StereoRig) -> Vec<Match> {
        let mut found = Vec::new();
        self.match_into(left, right, rig, &mut Workspace::default(), &mut found);
        found
    }
}

/// All matchers.
pub static MATCHERS: Registry<dyn Matcher> =
    Registry::new("matcher", &[entry!(EpipolarBand), entry!(LucasKanade), entry!(MutualRatio), entry!(ZnccBand)]);
