//! The largest accepted probability of a wrong answer.

use std::fmt;

use seafix_component::{Form, Settings};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error, Unexpected, Visitor},
};

/// The largest probability of being wrong at which an answer is accepted: a preset or a number.
///
/// ```
/// use seafix_referencing::{Acceptance, MaxPWrong};
///
/// let acceptance = Acceptance { max_p_wrong: MaxPWrong::Strict, ..Acceptance::default() };
/// assert_eq!(acceptance.max_p_wrong.value(), 1e-5);
/// assert_eq!(Acceptance::default().max_p_wrong.to_string(), "1.0e-3 (preset balanced)");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum MaxPWrong {
    /// 1e-5: for autonomous use without a second check of the fixes.
    Strict,
    /// 1e-3: for navigation, which fuses fixes behind a gate.
    #[default]
    Balanced,
    /// 2e-2: for studies, whose wrong answers are counted.
    Permissive,
    /// A probability above 0, at most 1; 1 accepts every probability.
    Number(f64),
}

impl MaxPWrong {
    /// The presets, the strictest first.
    pub const PRESETS: [Self; 3] = [Self::Strict, Self::Balanced, Self::Permissive];

    /// The probability.
    pub fn value(self) -> f64 {
        match self {
            Self::Strict => 1e-5,
            Self::Balanced => 1e-3,
            Self::Permissive => 2e-2,
            Self::Number(number) => number,
        }
    }

    /// The name of a preset in files; `None` for a number.
    pub fn preset(self) -> Option<&'static str> {
        match self {
            Self::Strict => Some("strict"),
            Self::Balanced => Some("balanced"),
            Self::Permissive => Some("permissive"),
            Self::Number(_) => None,
        }
    }

    /// The probability and the use of a preset.
    fn meaning(self) -> &'static str {
        match self {
            Self::Strict => "1e-5, for autonomous use without a second check of the fixes",
            Self::Balanced => "1e-3, for navigation, which fuses fixes behind a gate",
            Self::Permissive => "2e-2, for studies, whose wrong answers are counted",
            Self::Number(_) => "a probability",
        }
    }

    /// Whether a probability is accepted; a NaN is not.
    pub fn allows(self, probability: f64) -> bool {
        probability <= self.value()
    }
}

impl fmt::Display for MaxPWrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1e}", self.value())?;
        self.preset().map_or(Ok(()), |preset| write!(f, " (preset {preset})"))
    }
}

impl Settings for MaxPWrong {
    fn form() -> Form {
        let preset = |preset: &Self| Some((preset.preset()?, preset.meaning()));
        Form::OneOf(vec![Form::Words(Self::PRESETS.iter().filter_map(preset).collect()), Form::Number])
    }
}

impl Serialize for MaxPWrong {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.preset() {
            Some(preset) => serializer.serialize_str(preset),
            None => serializer.serialize_f64(self.value()),
        }
    }
}

impl<'de> Deserialize<'de> for MaxPWrong {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Setting)
    }
}

/// The visitor of the setting.
struct Setting;

impl Visitor<'_> for Setting {
    type Value = MaxPWrong;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a probability above 0, at most 1, or strict, balanced or permissive")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<MaxPWrong, E> {
        Ok(MaxPWrong::Number(number))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<MaxPWrong, E> {
        Ok(MaxPWrong::Number(number as f64))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<MaxPWrong, E> {
        Ok(MaxPWrong::Number(number as f64))
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<MaxPWrong, E> {
        let known = MaxPWrong::PRESETS.into_iter().find(|preset| preset.preset() == Some(word));
        known.ok_or_else(|| E::invalid_value(Unexpected::Str(word), &self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails if a preset has another name or number in files, and if a word that is none is taken.
    #[test]
    fn presets_and_numbers_are_written_as_they_are_read() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct File {
            at: MaxPWrong,
        }
        for (text, value) in [("\"strict\"", 1e-5), ("\"balanced\"", 1e-3), ("\"permissive\"", 2e-2), ("0.005", 5e-3)] {
            let file: File = serde_json::from_str(&format!("{{\"at\":{text}}}")).expect("a setting");
            assert_eq!(file.at.value(), value);
            assert_eq!(serde_json::to_string(&file).expect("plain"), format!("{{\"at\":{text}}}"));
        }
        let error = serde_json::from_str::<File>("{\"at\":\"lax\"}").expect_err("no preset").to_string();
        assert!(error.contains("or strict, balanced or permissive"), "{error}");
    }

    #[test]
    fn what_is_no_probability_is_not_allowed() {
        assert!(MaxPWrong::Balanced.allows(1e-3) && !MaxPWrong::Balanced.allows(1.1e-3));
        assert!(!MaxPWrong::Number(1.0).allows(f64::NAN));
    }
}
