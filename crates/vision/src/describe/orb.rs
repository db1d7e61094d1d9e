//! The ORB descriptor: BRIEF, rotated to the centroid of brightness.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    comparisons,
    descriptor::{Descriptor, Descriptors},
};
use crate::{detect::Keypoint, image::Image, workspace::Workspace};

/// ORB's descriptor: BRIEF-256, rotated by the direction from the key point to the centroid of brightness.
///
/// The centroid is that within 15 steps around the key point. Limit: the pattern is BRIEF's, drawn from a Gaussian and
/// kept within the circle, not ORB's own, which is learned on photographs.
///
/// Source: Rublee, Rabaud, Konolige and Bradski, *ORB: an efficient alternative to SIFT or SURF*, ICCV 2011; Rosin,
/// *Measuring corner properties*, 1999.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Orb {
    /// Step of the pattern (px), whose window is 35 steps wide; 0: half the key point's own scale.
    pub scale: f64,
}

impl Default for Orb {
    fn default() -> Self {
        Self { scale: 1.0 }
    }
}

impl Component for Orb {
    const NAME: &'static str = "orb";
    const SUMMARY: &'static str = "BRIEF rotated to the centroid of brightness around the key point";
    const SOURCE: &'static str =
        "Rublee, Rabaud, Konolige and Bradski, ORB: an efficient alternative to SIFT or SURF, ICCV 2011";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

impl Descriptor for Orb {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors) {
        let settings = comparisons::Settings { scale: self.scale, turned: true };
        comparisons::describe(&settings, image, keypoints, work, described);
    }
}
