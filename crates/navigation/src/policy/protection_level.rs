//! A fix when the predicted protection level exceeds a limit.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::situation::{Policy, Situation};

/// The policy that tries a fix when the predicted protection level exceeds `limit`.
///
/// The protection level is √χ²₃(1 − risk) times the standard deviation along the least accurate axis: an upper bound of
/// the radius that the position error exceeds with probability `risk`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct ProtectionLevel {
    /// Maximum protection level (m), above 0.
    pub limit: f64,
    /// Integrity risk: the probability that the error exceeds the protection level, between 0 and 1.
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
        in_range(self.limit > 0.0 && self.limit.is_finite(), "limit", self.limit, "a length above 0 (m)")?;
        in_range(self.risk > 0.0 && self.risk < 1.0, "risk", self.risk, "a number in (0, 1)")
    }
}

impl Policy for ProtectionLevel {
    fn due(&self, situation: &Situation) -> bool {
        let three = ChiSquared::new(3.0).expect("three degrees of freedom");
        !(three.inverse_cdf(1.0 - self.risk).sqrt() * situation.sigma <= self.limit)
    }
}
