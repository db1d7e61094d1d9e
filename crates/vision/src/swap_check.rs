//! The check for exchanged left and right images.

use seafix_geometry::StereoRig;

use crate::{
    describe::{Descriptor, Surf},
    detect::{Detector, Harris},
    image::Image,
    matching::{EpipolarBand, Match, View},
    workspace::Workspace,
};

/// The numbers of matches of two images in the given and in the exchanged order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sides {
    /// The number of matches in the given order.
    pub given: usize,
    /// The number of matches in the exchanged order.
    pub exchanged: usize,
    /// The number of matches that both orders admit.
    ///
    /// With principal points of different columns (x), as of converging cameras, exchanged disparities need not be negative:
    /// the farther points then lie in front of the cameras in both orders, and favour none.
    pub common: usize,
    /// The number of key points of the image that has fewer; many key points without matches mean unrelated images.
    pub keypoints: usize,
}

/// The minimum number of matches for a decision.
const FEW: usize = 20;

impl Sides {
    /// The counts of a pair of views, matched along the epipolar band in both orders.
    ///
    /// Points lie in front of the cameras, so a rig admits matches of the true order and few of the other. Exchanged
    /// images of a rectified rig give negative depths; those of any other rig also lie off their epipolar lines.
    ///
    /// The check costs two matchings. A data set's first frames suffice, with their counts added.
    pub fn of(left: &View<'_>, right: &View<'_>, rig: &StereoRig, work: &mut Workspace) -> Self {
        let mut find = |rig: &StereoRig| {
            let mut found = Vec::new();
            // Repeated patterns match in either order; ambiguous ones are kept in both so that neither order gains.
            EpipolarBand::default().find([left, right], rig, true, work, &mut found);
            found
        };
        let (given, exchanged) = (find(rig), find(&rig.exchanged()));
        // A left key point with matches in both orders counts for the one of smaller descriptor distance.
        let better = |found: &[Match], other: &[Match]| {
            let beaten = |m: &&Match| other.iter().any(|o| o.left == m.left && o.distance < m.distance);
            found.iter().filter(|m| !beaten(m)).count()
        };
        let same = |m: &&Match| exchanged.iter().any(|o| o.left == m.left && o.right == m.right);
        Self {
            given: better(&given, &exchanged),
            exchanged: better(&exchanged, &given),
            common: given.iter().filter(same).count(),
            keypoints: left.keypoints.len().min(right.keypoints.len()),
        }
    }

    /// The counts of a pair of images, with the default detector and descriptor.
    pub fn of_images(left: &Image, right: &Image, rig: &StereoRig) -> Self {
        let corners = [left, right].map(|image| Harris::default().detect(image));
        let described =
            [(left, &corners[0]), (right, &corners[1])].map(|(image, at)| Surf::default().describe(image, at));
        let view = |image, side: usize| View { image, keypoints: &corners[side], descriptors: &described[side] };
        Self::of(&view(left, 0), &view(right, 1), rig, &mut Workspace::default())
    }

    /// The number of matches.
    pub fn all(&self) -> usize {
        self.given + self.exchanged - self.common
    }

    /// The number of matches that lie behind the cameras in the given order only.
    pub fn behind(&self) -> usize {
        self.exchanged - self.common
    }

    /// Whether there are enough matches for a decision.
    pub fn is_decisive(&self) -> bool {
        self.all() >= FEW
    }

    /// Whether the images are unrelated: too few matches for a decision, and fewer than one for 20 key points.
    pub fn are_strangers(&self) -> bool {
        self.keypoints > 0 && !self.is_decisive() && 20 * self.given < self.keypoints
    }

    /// Whether the images are exchanged: by more than nine tenths of the matches that favour an order, which are at least
    /// 20 and a third of all. Fewer may be accidents where both orders admit nearly all.
    pub fn are_swapped(&self) -> bool {
        let decide = self.all() - self.common;
        decide >= FEW && 3 * decide >= self.all() && 10 * self.behind() > 9 * decide
    }
}

impl std::ops::Add for Sides {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            given: self.given + other.given,
            exchanged: self.exchanged + other.exchanged,
            common: self.common + other.common,
            keypoints: self.keypoints + other.keypoints,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of converging cameras, of parallel ones, and of a scene so far that both orders admit nearly all matches.
    /// Fails if the matches that both orders admit count against the exchange, or if a few accidents decide.
    #[test]
    fn matches_of_both_orders_favour_none() {
        let swapped = |given, exchanged, common| Sides { given, exchanged, common, keypoints: 1000 }.are_swapped();
        assert!(swapped(330, 682, 297) && !swapped(681, 329, 300));
        assert!(swapped(22, 819, 0) && !swapped(819, 22, 0));
        assert!(!swapped(901, 930, 900) && !swapped(0, 19, 0));
    }
}
