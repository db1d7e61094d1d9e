//! The limits of the acceptance tests.

use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

use super::max_p_wrong::MaxPWrong;
use crate::ablation::AcceptanceTest;

/// The limits of the tests by which an identified set becomes a fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acceptance {
    /// Minimum number of identified points, 3 or more.
    pub min_points: usize,
    /// Largest probability that the pose is not the object's: a number, or a preset.
    ///
    /// `strict` is 1e-5, for autonomous use without a second check; `balanced` is 1e-3, the default, for a navigator
    /// that fuses fixes behind a gate; `permissive` is 2e-2, for studies. The probability includes the object's absence
    /// and its other poses.
    pub max_p_wrong: MaxPWrong,
    /// Confidence of the χ² tests of residuals and prior; a correct set fails with one minus this probability.
    pub confidence: f64,
    /// Alert limit: the distance (m, RMS over the model points) beyond which two poses are different answers.
    ///
    /// A pose whose error may exceed the limit by its covariance (two sigma) is rejected. So is a pose of four points
    /// or more that one wrong match could move beyond it
    /// ([`RejectionReason::InfluentialPairs`](super::RejectionReason::InfluentialPairs)); a posterior of points weighs
    /// such matches instead.
    /// The fraction [`alert_fraction`](Self::alert_fraction) of the model's diameter replaces the limit if that is
    /// smaller.
    pub alert_limit: f64,
    /// Alert limit as a fraction of the model's diameter; the smaller of it and [`alert_limit`](Self::alert_limit)
    /// applies.
    pub alert_fraction: f64,
    /// Largest attitude error (rad), two standard deviations of the worst axis; a less precise pose is rejected.
    pub attitude_limit: f64,
    /// Integrity risk: the probability with which an error may exceed its protection level.
    pub risk: f64,
    /// Assumed fraction of accepted sets with one wrong match; the protection levels depend on it.
    pub wrong_match_rate: f64,
    /// Assumed fraction of accepted sets with two wrong matches; zero excludes the case from the protection levels.
    pub two_wrong_rate: f64,
    /// Assumed fraction of objects with a part displaced against the rest; the protection levels depend on it.
    ///
    /// Zero excludes the case, from the levels and from the test of consistency
    /// ([`RejectionReason::Inconsistent`](super::RejectionReason::Inconsistent)).
    pub moved_part_rate: f64,
    /// Tests to leave out, for ablation studies only; none by default.
    pub without: Vec<AcceptanceTest>,
}

impl Default for Acceptance {
    fn default() -> Self {
        Self {
            min_points: 3,
            max_p_wrong: MaxPWrong::Balanced,
            confidence: 0.999,
            alert_limit: 0.10,
            alert_fraction: 0.05,
            attitude_limit: 0.07,
            risk: 1e-4,
            wrong_match_rate: 0.1,
            two_wrong_rate: 0.0,
            moved_part_rate: 0.1,
            without: Vec::new(),
        }
    }
}

impl Acceptance {
    /// Whether a test applies.
    pub(super) fn with(&self, test: AcceptanceTest) -> bool {
        !self.without.contains(&test)
    }

    /// The Bayes factor of a displaced part beyond which the parts of an object are inconsistent.
    ///
    /// An object as modelled exceeds it with a probability of at most one minus the confidence (Markov's inequality).
    pub(super) fn max_bayes_factor(&self) -> f64 {
        1.0 / (1.0 - self.confidence)
    }

    /// Checks the range of every setting.
    ///
    /// # Errors
    ///
    /// The first invalid setting, with its range.
    pub fn check(&self) -> Result<(), String> {
        let check = || {
            in_range(self.min_points >= 3, "min-points", self.min_points, "3 or more")?;
            // A NaN is rejected as well.
            let p = self.max_p_wrong.value();
            let range = "a probability above 0, at most 1, or strict, balanced or permissive";
            in_range(p > 0.0 && p <= 1.0, "max-p-wrong", p, range)?;
            let confident = self.confidence > 0.0 && self.confidence < 1.0;
            in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
            let alert = self.alert_limit > 0.0 && self.alert_limit.is_finite();
            in_range(alert, "alert-limit", self.alert_limit, "a positive number of metres")?;
            let fraction = self.alert_fraction > 0.0 && self.alert_fraction.is_finite();
            in_range(fraction, "alert-fraction", self.alert_fraction, "a positive number")?;
            let turn = self.attitude_limit > 0.0 && self.attitude_limit.is_finite();
            in_range(turn, "attitude-limit", self.attitude_limit, "a positive angle (rad)")?;
            let risk = self.risk > 0.0 && self.risk < 1.0;
            in_range(risk, "risk", self.risk, "a probability between 0 and 1")?;
            let rate = self.wrong_match_rate > 0.0 && self.wrong_match_rate <= 1.0;
            in_range(rate, "wrong-match-rate", self.wrong_match_rate, "a fraction above 0, at most 1")?;
            let two = self.two_wrong_rate >= 0.0 && self.two_wrong_rate <= 1.0;
            in_range(two, "two-wrong-rate", self.two_wrong_rate, "a fraction from 0 to 1")?;
            let moved = self.moved_part_rate >= 0.0 && self.moved_part_rate <= 1.0;
            in_range(moved, "moved-part-rate", self.moved_part_rate, "a fraction from 0 to 1")
        };
        check().map_err(|message| format!("acceptance: {message}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        let good = Acceptance::default();
        assert_eq!(good.check(), Ok(()));
        let message = Acceptance { min_points: 2, ..good.clone() }.check().unwrap_err();
        assert_eq!(message, "acceptance: min-points = 2; give 3 or more");
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let number = MaxPWrong::Number(bad);
            assert!(Acceptance { max_p_wrong: number, ..good.clone() }.check().is_err(), "max-p-wrong = {bad}");
            assert!(Acceptance { confidence: bad, ..good.clone() }.check().is_err(), "confidence = {bad}");
            assert!(Acceptance { alert_limit: bad, ..good.clone() }.check().is_err(), "alert-limit = {bad}");
        }
        assert!(Acceptance { confidence: 1.0, ..good }.check().is_err());
    }
}
