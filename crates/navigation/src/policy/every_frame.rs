//! A fix in every frame.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::situation::{Policy, Situation};

/// The policy that tries a fix in every frame.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct EveryFrame {}

impl Component for EveryFrame {
    const NAME: &'static str = "every-frame";
    const SUMMARY: &'static str = "a fix is tried in every frame";
    const SOURCE: &'static str = "none";
}

impl Policy for EveryFrame {
    fn due(&self, _: &Situation) -> bool {
        true
    }
}
