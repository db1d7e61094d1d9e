//! A fix at fixed intervals of the path length.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::situation::{Policy, Situation};

/// The policy that tries a fix when the vehicle has travelled `metres` since the last one.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct Travelled {
    /// Minimum path length since the last fix (m), 0 or more.
    pub metres: f64,
}

impl Default for Travelled {
    fn default() -> Self {
        Self { metres: 10.0 }
    }
}

impl Component for Travelled {
    const NAME: &'static str = "travelled";
    const SUMMARY: &'static str = "a fix is tried when the path since the last one exceeds a length";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 3";

    fn check(&self) -> Result<(), String> {
        in_range(self.metres >= 0.0 && self.metres.is_finite(), "metres", self.metres, "a length of 0 or more (m)")
    }
}

impl Policy for Travelled {
    fn due(&self, situation: &Situation) -> bool {
        situation.metres >= self.metres
    }
}
