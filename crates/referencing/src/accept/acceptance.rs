//! When a pose is believed.

use seafix_component::in_range;
use serde::{Deserialize, Serialize};

/// When an identified set is believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acceptance {
    /// Least number of identified points.
    pub min_points: usize,
    /// Largest expected number of chance sets of the found size (a-contrario acceptance); of searches that weigh evidence, of
    /// those that are as good as the found one.
    pub max_nfa: f64,
    /// Largest probability, by a search that weighs evidence, that the object is not there at all; of a model of eight
    /// points. Of a larger one, of n points, (n + 1)/9 times as much, a hundredth at most, where the cloud fills space: its
    /// evidence comes about by chance so much more seldom. Where the cloud lies on lines and surfaces, of less than 2.3
    /// dimensions by the distances of neighbours, odds of ((n + 1)/9)^2.5 times less: there each point's evidence is too sure
    /// by something. A pattern that looks like the object is held to the former wherever clutter lies.
    pub absence: f64,
    /// Of putative pairs without a prior whose cloud fills space: largest expected number of chance sets as good as the one
    /// found with which a pose is believed whose object is absent with a probability of more than that, but of a twentieth
    /// at most.
    pub rare: f64,
    /// Largest probability, by a search that weighs evidence, that a present object is elsewhere.
    pub doubt: f64,
    /// Confidence of the χ² tests of residuals and prior: a true set fails with one minus this.
    pub confidence: f64,
    /// Poses further apart than this (m, RMS over the model points), or than [`alert_fraction`](Self::alert_fraction) of the
    /// model's diameter if that is less, are different answers; a pose that by its own covariance may be off
    /// by as much is none, and one of four points or more that is off by so much should any one of them be a wrong match
    /// ([`RejectionReason::Hinge`](super::RejectionReason::Hinge)).
    pub alert_limit: f64,
    /// The share of the model's diameter that limits it where that is less.
    pub alert_fraction: f64,
    /// A pose whose attitude may be off by as much (rad) by its own covariance, two standard deviations of its worst axis,
    /// is none.
    pub attitude_limit: f64,
    /// With what probability a protection level may be exceeded.
    pub risk: f64,
    /// Share of believed sets that hold one wrong match, as protection levels assume it.
    pub wrong_match_rate: f64,
    /// Share of believed sets that hold two wrong matches, as protection levels assume it; of none where it is nought.
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
    /// What is wrong with the settings, if something is.
    ///
    /// # Errors
    /// The first setting out of its range, and the range.
    pub fn check(&self) -> Result<(), String> {
        let check = || {
            in_range(self.min_points >= 3, "min-points", self.min_points, "3 or more")?;
            // Written so that a NaN is refused too.
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
            in_range(rate, "wrong-match-rate", self.wrong_match_rate, "a share above 0, at most 1")?;
            let two = self.two_wrong_rate >= 0.0 && self.two_wrong_rate <= 1.0;
            in_range(two, "two-wrong-rate", self.two_wrong_rate, "a share from 0 to 1")
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
