//! Selections of trials in written answers: `method=the defaults, altitude=2.5|3.5`.

use super::{
    error::AnswerError,
    quotes::{split, unquoted},
};

/// The trials that a query is about, by their values on the axes of the experiment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Selection {
    /// The text as it was written.
    pub(crate) text: String,
    /// The conditions; none selects all trials.
    pub(crate) conditions: Vec<Condition>,
}

/// A condition on one axis, or on a part of the trials.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Condition {
    /// The short name of the axis, or of the part: `object`, `point`, `from`, `in-view`.
    pub(crate) key: String,
    /// The permitted values; none permits all.
    pub(crate) values: Vec<String>,
}

impl Selection {
    /// Parses `AXIS=VALUE, AXIS=VALUE|VALUE, AXIS=any`, or `all`.
    pub(super) fn parse(text: &str, place: &str) -> Result<Self, AnswerError> {
        let condition = |part: &str| {
            let (key, value) = part
                .split_once('=')
                .filter(|(key, value)| !key.trim().is_empty() && !value.trim().is_empty())
                .ok_or_else(|| {
                    let remedy =
                        "write AXIS=VALUE, separated by commas, or `all`; put a value with a comma in double quotes";
                    AnswerError::new(place, format!("`{part}` selects no trial"), remedy)
                })?;
            let values = match value.trim() {
                "any" => Vec::new(),
                value => split(value, "|").into_iter().map(|value| unquoted(value).to_owned()).collect(),
            };
            Ok(Condition { key: key.trim().to_owned(), values })
        };
        let conditions = match text {
            "all" => Vec::new(),
            _ => split(text, ",").into_iter().map(condition).collect::<Result<_, _>>()?,
        };
        Ok(Self { text: text.to_owned(), conditions })
    }
}
