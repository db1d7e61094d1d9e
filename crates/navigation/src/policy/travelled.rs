//! A fix every so many metres.

use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{Policy, Situation};

/// Tries when the vehicle has come `metres` since the last fix.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Travelled {
    /// The way (m) after which a fix is due.
    pub metres: f64,
}

impl Default for Travelled {
    fn default() -> Self {
        Self { metres: 10.0 }
    }
}

impl Component for Travelled {
    const NAME: &'static str = "travelled";
    const SUMMARY: &'static str = "a fix is tried so many metres after the last one";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 3";

    fn check(&self) -> Result<(), String> {
        in_range(self.metres >= 0.0 && self.metres.is_finite(), "metres", self.metres, "zero or above")
    }
}

impl Policy for Travelled {
    fn due(&self, situation: &Situation) -> bool {
        situation.metres >= self.metres
    }
}
