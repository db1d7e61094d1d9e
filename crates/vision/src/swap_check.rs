//! Whether the left and the right image have changed places.

use seafix_geometry::StereoRig;

use crate::{Descriptor, Detector, EpipolarBand, Harris, Image, Match, Surf, View, Workspace};

/// How many matches two images have as they came and with their places exchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sides {
    /// The left image seen by the left camera.
    pub given: usize,
    /// The left image seen by the right camera.
    pub exchanged: usize,
    /// Key points of whichever image has fewer: with many of them a pair of images has matches.
    pub keypoints: usize,
}

/// Fewer matches say nothing about the order of the images.
const FEW: usize = 20;

impl Sides {
    /// What these two views of one frame say, matched along the epipolar band in both orders.
    ///
    /// Points lie in front of the cameras, so a rig allows the true order's matches and few of the other: with
    /// exchanged images of a rectified rig every depth is negative, and of any other rig the points are off their
    /// epipolar lines besides. It takes as long as matching twice; a data set's first frames are enough, their
    /// counts added up.
    pub fn of(left: &View<'_>, right: &View<'_>, rig: &StereoRig, work: &mut Workspace) -> Self {
        let mut find = |rig: &StereoRig| {
            let mut found = Vec::new();
            // A pattern fits in either order: left out of one alone it would speak for the other.
            EpipolarBand::default().find([left, right], rig, true, work, &mut found);
            found
        };
        let (given, exchanged) = (find(rig), find(&rig.exchanged()));
        // A left key point that found something in either order speaks for the one that looks more alike.
        let better = |found: &[Match], other: &[Match]| {
            let beaten = |m: &&Match| other.iter().any(|o| o.left == m.left && o.distance < m.distance);
            found.iter().filter(|m| !beaten(m)).count()
        };
        Self {
            given: better(&given, &exchanged),
            exchanged: better(&exchanged, &given),
            keypoints: left.keypoints.len().min(right.keypoints.len()),
        }
    }

    /// What two images say by their corners, found and described with the defaults.
    pub fn of_images(left: &Image, right: &Image, rig: &StereoRig) -> Self {
        let corners = [left, right].map(|image| Harris::default().detect(image));
        let described =
            [(left, &corners[0]), (right, &corners[1])].map(|(image, at)| Surf::default().describe(image, at));
        let view = |image, side: usize| View { image, keypoints: &corners[side], descriptors: &described[side] };
        Self::of(&view(left, 0), &view(right, 1), rig, &mut Workspace::default())
    }

    /// Whether there are enough matches to say anything.
    pub fn is_decisive(&self) -> bool {
        self.given + self.exchanged >= FEW
    }

    /// Whether key points found no, or hardly any, partners: too few matches to tell, and fewer than one key point in twenty has one.
    pub fn are_strangers(&self) -> bool {
        self.keypoints > 0 && !self.is_decisive() && 20 * self.given < self.keypoints
    }

    /// Whether the images have changed places: more than nine in ten of at least twenty matches say so.
    pub fn are_swapped(&self) -> bool {
        self.is_decisive() && 10 * self.exchanged > 9 * (self.given + self.exchanged)
    }
}

impl std::ops::Add for Sides {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            given: self.given + other.given,
            exchanged: self.exchanged + other.exchanged,
            keypoints: self.keypoints + other.keypoints,
        }
    }
}
