//! Matchers of key points.

use seafix_geometry::{Pixel, StereoRig};

use crate::{describe::Descriptors, detect::Keypoint, image::Image, workspace::Workspace};

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
///
/// ```
/// # use nalgebra::{UnitQuaternion, Vector3};
/// # use seafix_geometry::{Pinhole, Transform};
/// use seafix_geometry::{Pixel, StereoRig};
/// use seafix_vision::{Descriptors, Image, Keypoint, Match, Matcher, View, Workspace};
///
/// /// Pairs key points of equal index.
/// #[derive(Debug)]
/// struct SameIndex;
///
/// impl Matcher for SameIndex {
///     fn match_into(
///         &self,
///         left: &View<'_>,
///         right: &View<'_>,
///         _: &StereoRig,
///         _: &mut Workspace,
///         found: &mut Vec<Match>,
///     ) {
///         found.clear();
///         let pairs = left.keypoints.iter().zip(right.keypoints).enumerate();
///         found.extend(pairs.map(|(left, (_, right))| Match { left, right: right.at, distance: 0.0 }));
///     }
///
///     fn compares_descriptors(&self) -> bool {
///         false
///     }
/// }
///
/// # let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
/// # let right_from_left = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
/// # let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
/// let image = Image::new(1024, 768, vec![0.0; 1024 * 768]).unwrap();
/// let descriptors = Descriptors::default();
/// let keypoint = |u| Keypoint { at: Pixel { u, v: 300.0 }, response: 1.0, scale: 1.0 };
/// let (left, right) = ([keypoint(500.0)], [keypoint(460.0)]);
/// let left = View { image: &image, keypoints: &left, descriptors: &descriptors };
/// let right = View { image: &image, keypoints: &right, descriptors: &descriptors };
/// assert_eq!(SameIndex.matches(&left, &right, &rig)[0].right, Pixel { u: 460.0, v: 300.0 });
/// ```
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
