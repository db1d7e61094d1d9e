//! Faults of written answers.

/// A fault of a written answer or of a claim: place, description and remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} in `{place}`; {remedy}")]
pub struct AnswerError {
    /// The query or claim with the fault, as it was written.
    pub place: String,
    /// The description of the fault.
    pub what: String,
    /// The remedy.
    pub remedy: String,
}

impl AnswerError {
    pub(crate) fn new(place: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { place: place.to_owned(), what: what.into(), remedy: remedy.into() }
    }
}
