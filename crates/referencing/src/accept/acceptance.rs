//! The limits of the acceptance tests.

use seafix_component::in_range;
use serde::{Deserialize, Serialize};

/// The limits of the tests by which an identified set becomes a fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acceptance {
    /// Minimum number of identified points, 3 or more.
    pub min_points: usize,
    /// Largest number of false alarms (NFA): the expected number of random sets of the same size.
    ///
    /// For a search that weighs evidence, it counts random sets as good as the one found.
    pub max_nfa: f64,
    /// Largest posterior probability of the object's absence, for a model of eight points; used by searches that weigh
    /// evidence.
    ///
    /// For a larger model of n points the limit depends on the clutter. If the cloud fills space, the limit is (n +
    /// 1)/9 times larger, at most 0.01, since random evidence is that much rarer. If the cloud lies on lines and
    /// surfaces (less than 2.3 dimensions, by the distances of neighbours), the odds are ((n + 1)/9)^2.5 times smaller,
    /// since each point's evidence is overestimated there. A repeated pattern that resembles the object has the former
    /// limit in every cloud.
    pub absence: f64,
    /// Largest NFA at which a pose is accepted although its probability of absence exceeds [`absence`](Self::absence).
    ///
    /// It applies to putative pairs without a prior whose cloud fills space; the probability of absence must be at most
    /// 0.05.
    pub rare: f64,
    /// Largest posterior probability that a present object has another pose; used by searches that weigh evidence.
    pub doubt: f64,
    /// Confidence of the χ² tests of residuals and prior; a correct set fails with one minus this probability.
    pub confidence: f64,
    /// Alert limit: the distance (m, RMS over the model points) beyond which two poses are different answers.
    ///
    /// A pose whose error may exceed the limit by its covariance (two sigma) is rejected. So is a pose of four points
    /// or more that one wrong match could move beyond it ([`RejectionReason::Hinge`](super::RejectionReason::Hinge)).
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
}

impl Default for Acceptance {
    fn default() -> Self {
        Self {
            min_points: 3,
            max_nfa: 1e-3,
            absence: 2e-5,
            rare: 3e-5,
            doubt: 0.01,
            confidence: 0.999,
            alert_limit: 0.10,
            alert_fraction: 0.05,
            attitude_limit: 0.07,
            risk: 1e-4,
            wrong_match_rate: 0.1,
            two_wrong_rate: 0.0,
        }
    }
}

impl Acceptance {
    /// Checks the range of every setting.
    ///
    /// # Errors
    ///
    /// The first invalid setting, with its range.
    pub fn check(&self) -> Result<(), String> {
        let check = || {
            in_range(self.min_points >= 3, "min-points", self.min_points, "3 or more")?;
            // A NaN is rejected as well.
            let budget = self.max_nfa > 0.0 && self.max_nfa.is_finite();
            in_range(budget, "max-nfa", self.max_nfa, "a positive number")?;
            for (name, value) in [("absence", self.absence), ("rare", self.rare), ("doubt", self.doubt)] {
                in_range(value > 0.0 && value < 1.0, name, value, "a probability between 0 and 1")?;
            }
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
            in_range(two, "two-wrong-rate", self.two_wrong_rate, "a fraction from 0 to 1")
        };
        check().map_err(|message| format!("acceptance: {message}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_refused() {
        let good = Acceptance::default();
        assert_eq!(good.check(), Ok(()));
        let message = Acceptance { min_points: 2, ..good.clone() }.check().unwrap_err();
        assert_eq!(message, "acceptance: min-points = 2; give 3 or more");
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Acceptance { max_nfa: bad, ..good.clone() }.check().is_err(), "max-nfa = {bad}");
            assert!(Acceptance { confidence: bad, ..good.clone() }.check().is_err(), "confidence = {bad}");
            assert!(Acceptance { alert_limit: bad, ..good.clone() }.check().is_err(), "alert-limit = {bad}");
        }
        assert!(Acceptance { confidence: 1.0, ..good }.check().is_err());
    }
}
