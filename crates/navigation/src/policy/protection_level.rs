//! A fix when the pose is no longer good enough.

use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Policy, Situation};

/// Tries when the predicted protection level exceeds a limit.
///
/// The radius that the position's error exceeds with probability `risk` is at most √χ²₃(1 − risk)
/// times the standard deviation along the worst axis.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ProtectionLevel {
    /// The radius (m) at which a fix is due.
    pub limit: f64,
    /// The probability that the error is larger.
    pub risk: f64,
}

impl Default for ProtectionLevel {
    fn default() -> Self {
        Self { limit: 0.05, risk: 1e-4 }
    }
}

impl Component for ProtectionLevel {
    const NAME: &'static str = "protection-level";
    const SUMMARY: &'static str = "a fix is tried when the predicted protection level exceeds a limit";
    const SOURCE: &'static str = "RTCA DO-229, Minimum operational performance standards for GPS/WAAS, the notion";

    fn check(&self) -> Result<(), String> {
        in_range(self.limit > 0.0 && self.limit.is_finite(), "limit", self.limit, "above zero")?;
        in_range(self.risk > 0.0 && self.risk < 1.0, "risk", self.risk, "between zero and one")
    }
}

impl Policy for ProtectionLevel {
    fn due(&self, situation: &Situation) -> bool {
        let three = ChiSquared::new(3.0).expect("three degrees of freedom");
        !(three.inverse_cdf(1.0 - self.risk).sqrt() * situation.sigma <= self.limit)
    }
}
