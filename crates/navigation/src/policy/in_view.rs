//! A fix whenever an object should be in view.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::situation::{Policy, Situation};

/// The policy that tries a fix when the known pose puts an object in view.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct InView {}

impl Component for InView {
    const NAME: &'static str = "in-view";
    const SUMMARY: &'static str = "a fix is tried when an object should be in view";
    const SOURCE: &'static str = "none";
}

impl Policy for InView {
    fn due(&self, situation: &Situation) -> bool {
        situation.in_view
    }
}
