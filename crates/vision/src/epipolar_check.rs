//! The check of a rig's calibration against a pair of images.

use seafix_geometry::{StereoPixels, StereoRig};

use crate::{
    describe::{Descriptor, Surf},
    detect::{Detector, Harris},
    image::Image,
    matching::{Matcher, MutualRatio, View},
    workspace::Workspace,
};

/// The distances of matches from the epipolar lines of a rig; the rig takes no part in the matching.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EpipolarCheck {
    /// The number of matches.
    pub matches: usize,
    /// The number of matches within [`NEAR`](Self::NEAR) of their epipolar lines.
    pub near: usize,
    /// The RMS distance (px) to the epipolar lines of the nearest three quarters of matches; the rest may be false.
    pub rms_px: f64,
}

impl EpipolarCheck {
    /// The largest distance (px) that a good calibration leaves, with a margin.
    pub const NEAR: f64 = 3.0;
    /// The minimum number of matches for a decision.
    const FEW: usize = 30;

    /// The check of a pair of images, with the default detector and descriptor.
    pub fn of_images(left: &Image, right: &Image, rig: &StereoRig) -> Self {
        let seen = matches_by_appearance(left, right, rig);
        let mut off: Vec<f64> = seen.iter().filter_map(|seen| rig.epipolar_distance(seen)).collect();
        off.sort_by(f64::total_cmp);
        let nearer = &off[..off.len() - off.len() / 4];
        let squares: f64 = nearer.iter().map(|off| off * off).sum();
        Self {
            matches: off.len(),
            near: off.partition_point(|off| *off <= Self::NEAR),
            rms_px: (squares / nearer.len().max(1) as f64).sqrt(),
        }
    }

    /// Whether the images contradict the rig: fewer than a quarter of at least 30 matches lie near their epipolar
    /// lines.
    pub fn contradict(&self) -> bool {
        self.matches >= Self::FEW && 4 * self.near < self.matches
    }
}

/// The matches of two images by appearance alone, with the default detector and descriptor.
///
/// The rig takes no part in the matching.
pub fn matches_by_appearance(left: &Image, right: &Image, rig: &StereoRig) -> Vec<StereoPixels> {
    let corners = [left, right].map(|image| Harris::default().detect(image));
    let described = [(left, &corners[0]), (right, &corners[1])].map(|(image, at)| Surf::default().describe(image, at));
    let view = |image, side: usize| View { image, keypoints: &corners[side], descriptors: &described[side] };
    let mut found = Vec::new();
    MutualRatio::default().match_into(&view(left, 0), &view(right, 1), rig, &mut Workspace::default(), &mut found);
    found.iter().map(|pair| StereoPixels { left: corners[0][pair.left].at, right: pair.right }).collect()
}
