//! A fix at fixed intervals of time.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::situation::{Policy, Situation};

/// The policy that tries a fix when the last one is older than `seconds`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct Interval {
    /// Minimum age of the last fix (s), 0 or more.
    pub seconds: f64,
}

impl Default for Interval {
    fn default() -> Self {
        Self { seconds: 10.0 }
    }
}

impl Component for Interval {
    const NAME: &'static str = "interval";
    const SUMMARY: &'static str = "a fix is tried when the last one is older than a limit";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 3";

    fn check(&self) -> Result<(), String> {
        in_range(self.seconds >= 0.0 && self.seconds.is_finite(), "seconds", self.seconds, "a time of 0 or more (s)")
    }
}

impl Policy for Interval {
    fn due(&self, situation: &Situation) -> bool {
        situation.seconds >= self.seconds
    }
}
