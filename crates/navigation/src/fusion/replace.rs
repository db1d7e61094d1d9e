//! Replacement of the known pose by the fix.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::rule::{Contradiction, Fusion};
use crate::chain::ObjectPose;

/// Plain replacement: every fix is accepted, and the previous pose is discarded.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct Replace {}

impl Component for Replace {
    const NAME: &'static str = "replace";
    const SUMMARY: &'static str = "every fix replaces the known pose";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 2.4";
}

impl Fusion for Replace {
    fn take(&self, _: &ObjectPose, fix: &ObjectPose) -> Result<ObjectPose, Contradiction> {
        Ok(fix.clone())
    }

    fn passes(&self, _: &ObjectPose, _: &ObjectPose) -> bool {
        true
    }
}
