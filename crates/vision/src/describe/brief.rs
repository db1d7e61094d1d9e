//! The BRIEF descriptor: 256 comparisons of brightness.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    comparisons,
    descriptor::{Descriptor, Descriptors},
};
use crate::{detect::Keypoint, image::Image, workspace::Workspace};

/// BRIEF-256, upright: one bit for each of 256 pairs of points, set if the first is darker.
///
/// The points are drawn from a Gaussian of 31/5 steps around the key point. Means over squares of 5 steps are compared,
/// at the key point's subpixel position. Distances are Hamming distances. The descriptor is invariant under any
/// increasing function of brightness, hence under offset and contrast.
///
/// Source: Calonder, Lepetit, Strecha and Fua, *BRIEF: binary robust independent elementary features*, ECCV 2010 (its
/// pattern G II).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Brief {
    /// Step of the pattern (px), whose window is 35 steps wide; 0: half the key point's own scale.
    pub scale: f64,
}

impl Default for Brief {
    fn default() -> Self {
        Self { scale: 1.0 }
    }
}

impl Component for Brief {
    const NAME: &'static str = "brief";
    const SUMMARY: &'static str = "BRIEF: 256 comparisons of brightness around the key point, upright";
    const SOURCE: &'static str =
        "Calonder, Lepetit, Strecha and Fua, BRIEF: binary robust independent elementary features, ECCV 2010";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

impl Descriptor for Brief {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors) {
        let settings = comparisons::Settings { scale: self.scale, turned: false };
        comparisons::describe(&settings, image, keypoints, work, described);
    }
}
