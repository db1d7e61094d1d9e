//! A fix every so many seconds.

use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{Policy, Situation};

/// Tries when the last fix is older than `seconds`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Interval {
    /// The age (s) at which a fix is due.
    pub seconds: f64,
}

impl Default for Interval {
    fn default() -> Self {
        Self { seconds: 10.0 }
    }
}

impl Component for Interval {
    const NAME: &'static str = "interval";
    const SUMMARY: &'static str = "a fix is tried when the last one is so many seconds old";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 3";

    fn check(&self) -> Result<(), String> {
        in_range(self.seconds >= 0.0 && self.seconds.is_finite(), "seconds", self.seconds, "zero or above")
    }
}

impl Policy for Interval {
    fn due(&self, situation: &Situation) -> bool {
        situation.seconds >= self.seconds
    }
}
