//! The printed form of the values of written answers.

use crate::{
    answer::{AnswerError, Part, Shown},
    content::front::measured::Measured,
    document::{Text, text},
};

/// The value of the query `place` as it is printed.
pub(super) fn shown(value: Measured, how: Shown, place: &str) -> Result<Text, AnswerError> {
    let value = if how.bare { value.with_unit("") } else { value };
    let [low, high] = value.ends();
    let end = match how.part {
        Part::Value => return Ok(text![value.number(), value.unit()]),
        Part::Interval if value.has_ends() => return Ok(value.text()),
        Part::Interval => None,
        Part::Low => Some(low),
        Part::High => Some(high),
    };
    match (end, value.interval()) {
        (Some(end), Some(_)) => Ok(text![end, value.unit()]),
        _ => Err(AnswerError::new(
            place,
            "no interval of this value",
            "leave out the option, or state the number of fixes",
        )),
    }
}
