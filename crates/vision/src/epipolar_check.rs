//! Whether two images were taken by the rig that they are said to be.

use seafix_geometry::{StereoPixels, StereoRig};

use crate::{Descriptor, Detector, Harris, Image, Matcher, MutualRatio, Surf, View, Workspace};

/// How far corners that look alike in both images lie off their epipolar lines, matched without the rig.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EpipolarCheck {
    /// Corners that look alike.
    pub matches: usize,
    /// Those of them that lie within [`NEAR`](Self::NEAR) of their epipolar line.
    pub near: usize,
    /// Root mean square of the distances to the epipolar lines, of the nearer three quarters: some matches are false (px).
    pub rms_px: f64,
}

impl EpipolarCheck {
    /// What a good calibration leaves, with room (px).
    pub const NEAR: f64 = 3.0;
    /// Fewer matches say nothing.
    const FEW: usize = 30;

    /// What two images say by their corners, found and described with the defaults.
    pub fn of_images(left: &Image, right: &Image, rig: &StereoRig) -> Self {
        let seen = repeated_patterns(left, right, rig);
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

    /// Whether the images contradict the rig: fewer than a quarter of at least thirty matches lie near their epipolar lines.
    pub fn contradict(&self) -> bool {
        self.matches >= Self::FEW && 4 * self.near < self.matches
    }
}

/// Corners that look alike in both images, found and described with the defaults; the rig plays no part in which.
pub fn repeated_patterns(left: &Image, right: &Image, rig: &StereoRig) -> Vec<StereoPixels> {
    let corners = [left, right].map(|image| Harris::default().detect(image));
    let described = [(left, &corners[0]), (right, &corners[1])].map(|(image, at)| Surf::default().describe(image, at));
    let view = |image, side: usize| View { image, keypoints: &corners[side], descriptors: &described[side] };
    let mut found = Vec::new();
    MutualRatio::default().match_into(&view(left, 0), &view(right, 1), rig, &mut Workspace::default(), &mut found);
    found.iter().map(|pair| StereoPixels { left: corners[0][pair.left].at, right: pair.right }).collect()
}
