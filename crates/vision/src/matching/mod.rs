//! Matchers of left and right key points.

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

/// One image with its key points and descriptors.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The image.
    pub image: &'a Image,
    /// The key points.
    pub keypoints: &'a [Keypoint],
    /// The descriptors, in the order of the key points.
    pub descriptors: &'a Descriptors,
}

/// A match: a left key point and its pixel in the right image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// The index of the left key point.
    pub left: usize,
    /// The pixel in the right image: a right key point's or any other.
    pub right: Pixel,
    /// The dissimilarity in the matcher's own measure; smaller is more similar.
    pub distance: f32,
}

/// A matcher: pairs left key points with pixels of the right image, each at most once.
pub trait Matcher: Send + Sync + std::fmt::Debug {
    /// Replaces `found` by the matches, in the order of the left key points.
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    );

    /// Whether the matcher compares descriptors; otherwise none are computed.
    fn compares_descriptors(&self) -> bool {
        true
    }

    /// The matches of two views, in the order of the left key points.
    fn matches(&self, left: &View<'_>, right: &View<'_>, rig: &StereoRig) -> Vec<Match> {
        let mut found = Vec::new();
        self.match_into(left, right, rig, &mut Workspace::default(), &mut found);
        found
    }
}

/// All matchers.
pub static MATCHERS: Registry<dyn Matcher> =
    Registry::new("matcher", &[entry!(EpipolarBand), entry!(LucasKanade), entry!(MutualRatio), entry!(ZnccBand)]);
