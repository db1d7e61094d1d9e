//! The locator that keeps the detector's positions.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::locator::{Locator, UncertainPixel};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// Keeps each key point at the peak of the detector's response.
///
/// The position is right for texture, and 1 to 2 px inside the corner of a box.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Peak {}

impl Component for Peak {
    const NAME: &'static str = "peak";
    const SUMMARY: &'static str = "key points stay at the peak of the detector's response";
    const SOURCE: &'static str = "none";
}

impl Locator for Peak {
    fn locate_into(
        &self,
        _: &Image,
        keypoints: &[Keypoint],
        _: &mut Workspace,
        places: &mut Vec<Option<UncertainPixel>>,
    ) {
        places.clear();
        places.resize(keypoints.len(), None);
    }
}
