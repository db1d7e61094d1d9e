//! Number ranges in equal steps or ratios.

use seafix_component::{Form, Settings};
use serde::{Deserialize, Serialize};

/// Numbers from one end to the other, both included.
///
/// ```
/// let range: seafix_experiment::Range = toml::from_str("from = 1\nto = 5\nstep = 2").unwrap();
/// assert_eq!(range.even().collect::<Vec<_>>(), [1.into(), 3.into(), 5.into()]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The first number.
    pub from: Number,
    /// The last number; with `step`, reached after a whole number of steps.
    pub to: Number,
    /// The number of values, 2 to 10000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[setting(form = Count)]
    pub count: Option<usize>,
    /// The step from number to number, as an alternative to `count`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Number>,
}

/// A number in TOML.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Settings)]
#[serde(untagged)]
pub enum Number {
    /// An integer. A range with integer ends and integer steps has integer values.
    Integer(i64),
    /// A real number.
    Real(f64),
}

impl Number {
    fn real(self) -> f64 {
        match self {
            Self::Integer(full) => full as f64,
            Self::Real(real) => real,
        }
    }

    fn is_integer(self) -> bool {
        matches!(self, Self::Integer(_))
    }
}

/// The maximum number of values.
const MAX: usize = 10_000;

/// The form of a number of values.
struct Count;

impl Settings for Count {
    fn form() -> Form {
        Form::Integer { min: 2, max: MAX as i64 }
    }
}

/// The fraction of a step that counts as rounding.
const ROUNDING: f64 = 1e-9;

impl Range {
    /// The values in equal steps.
    pub fn even(&self) -> impl Iterator<Item = toml::Value> + use<> {
        let (from, to) = (self.from.real(), self.to.real());
        let steps = match self.step {
            // The last step may be too long by rounding.
            Some(step) => ((to - from) / step.real() + ROUNDING).floor() as usize,
            None => self.count.unwrap_or(2).saturating_sub(1),
        };
        let step = self.step.map_or((to - from) / steps.max(1) as f64, Number::real);
        let full = self.from.is_integer() && self.step.map_or(step.fract() == 0.0, Number::is_integer);
        (0..=steps).map(move |k| {
            let value = from + step * k as f64;
            if full { toml::Value::Integer(value as i64) } else { toml::Value::Float(rounded(value, 12)) }
        })
    }

    /// The values in equal ratios, rounded to six digits.
    pub fn geometric(&self) -> impl Iterator<Item = toml::Value> + use<> {
        let (from, to) = (self.from.real().ln(), self.to.real().ln());
        let steps = self.count.unwrap_or(2).saturating_sub(1);
        (0..=steps)
            .map(move |k| toml::Value::Float(rounded((from + (to - from) * k as f64 / steps.max(1) as f64).exp(), 6)))
    }

    /// Checks the range, for equal `ratios` or for equal steps.
    ///
    /// # Errors
    /// The faulty key and the message.
    pub(crate) fn check(&self, ratios: bool) -> Result<(), (&'static str, String)> {
        let (from, to) = (self.from.real(), self.to.real());
        let refuse = |key, what: &str| Err((key, what.to_owned()));
        if !(from.is_finite() && to.is_finite()) || from == to {
            let key = if from.is_finite() { "to" } else { "from" };
            return refuse(key, "a range without two different finite ends; give two");
        }
        if ratios && !(from > 0.0 && to > 0.0) {
            let key = if from > 0.0 { "to" } else { "from" };
            return refuse(key, "a log-range with an end at or below zero; give two ends above zero");
        }
        match (self.count, self.step) {
            (Some(count), None) if (2..=MAX).contains(&count) => Ok(()),
            (Some(_), None) => refuse("count", "a range of too few or too many numbers; give a count from 2 to 10000"),
            (None, Some(_)) if ratios => refuse("step", "a log-range with a step; give a count"),
            (None, Some(step)) => {
                let steps = (to - from) / step.real();
                if !(steps >= 1.0 - ROUNDING && steps < MAX as f64) {
                    return refuse("step", "a step that does not lead from one end to the other in 1 to 10000 steps");
                }
                if (steps - steps.round()).abs() <= ROUNDING {
                    return Ok(());
                }
                let below = rounded(from + steps.floor() * step.real(), 12);
                let beyond = rounded(below + step.real(), 12);
                let what =
                    format!("a range whose steps do not reach its end, {to}; give {below} or {beyond}, or a count");
                Err(("to", what))
            }
            (Some(_), Some(_)) => refuse("step", "a range with a count and a step; give one of them"),
            (None, None) => refuse("from", "a range with neither count nor step; give one of them"),
        }
    }
}

/// A number rounded to `digits` significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(text: &str) -> Range {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn both_ends_are_in_it() {
        let values = |text: &str| range(text).even().map(|v| v.to_string()).collect::<Vec<_>>().join(" ");
        assert_eq!(values("from = 0.1\nto = 0.5\ncount = 5"), "0.1 0.2 0.3 0.4 0.5");
        assert_eq!(values("from = 0.0\nto = 0.3\nstep = 0.1"), "0.0 0.1 0.2 0.3");
        assert_eq!(values("from = 10\nto = 4\nstep = -2"), "10 8 6 4");
        assert_eq!(values("from = 0\nto = 1\ncount = 3"), "0.0 0.5 1.0");
        let ratios: Vec<_> = range("from = 0.05\nto = 0.8\ncount = 5").geometric().collect();
        assert_eq!(ratios, [0.05, 0.1, 0.2, 0.4, 0.8].map(toml::Value::Float));
    }

    #[test]
    fn what_leads_nowhere_is_rejected() {
        for wrong in [
            "from = 1\nto = 1\ncount = 2",
            "from = 0\nto = 1",
            "from = 0\nto = 1\nstep = -1",
            "from = 0\nto = 1\ncount = 1",
            "from = 0\nto = nan\ncount = 2",
            "from = 0\nto = 1\nstep = 0",
        ] {
            assert!(range(wrong).check(false).is_err(), "{wrong}");
        }
        let (key, what) = range("from = 1\nto = 2\nstep = 0.3").check(false).unwrap_err();
        assert_eq!(key, "to");
        assert!(what.contains("do not reach its end, 2; give 1.9 or 2.2"), "{what}");
        for right in [
            "from = 0.0\nto = 0.6\nstep = 0.2",
            "from = 10\nto = 4\nstep = -2",
            "from = 0.0\nto = 1e4\nstep = 1.1111111111111112",
        ] {
            assert!(range(right).check(false).is_ok(), "{right}");
        }
        assert!(range("from = 0\nto = 1\ncount = 3").check(true).is_err());
    }
}
