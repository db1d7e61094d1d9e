//! Matchers of straight segments.

use seafix_geometry::StereoRig;

use super::fit::FittedSegment;
use crate::{image::Image, workspace::Workspace};

/// One image with its fitted segments.
#[derive(Debug, Clone, Copy)]
pub struct SegmentView<'a> {
    /// The image.
    pub image: &'a Image,
    /// The segments.
    pub segments: &'a [FittedSegment],
}

/// A match of a left and a right segment, by their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentMatch {
    /// The index of the left segment.
    pub left: usize,
    /// The index of the right segment.
    pub right: usize,
}

/// A matcher of segments: pairs left segments with right ones, each at most once.
pub trait SegmentMatcher: Send + Sync + std::fmt::Debug {
    /// Replaces `found` by the matches, in the order of the left segments.
    fn match_into(
        &self,
        left: &SegmentView<'_>,
        right: &SegmentView<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<SegmentMatch>,
    );

    /// The matches of two views, in the order of the left segments.
    fn matches(&self, left: &SegmentView<'_>, right: &SegmentView<'_>, rig: &StereoRig) -> Vec<SegmentMatch> {
        let mut found = Vec::new();
        self.match_into(left, right, rig, &mut Workspace::default(), &mut found);
        found
    }
}
