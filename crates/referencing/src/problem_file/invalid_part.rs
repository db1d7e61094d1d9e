//! Invalid values of a problem, and the ranges that its parts have in common.

use std::fmt;

/// The largest standard deviation (m); the cube of its variance is still finite.
pub(super) const MAX_SIGMA: f64 = 1e15;
/// The largest model coordinate (m); a double resolves no micrometres beyond. A cloud may have outliers farther away.
pub(super) const FARTHEST: f64 = 1e9;
/// The largest rounding error of a covariance, as a fraction of its largest entry.
pub(super) const ROUNDING: f64 = 1e-9;

/// An invalid value of [`Parts`](super::Parts).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InvalidPart {
    /// The description of the fault.
    pub what: String,
    /// The path to the value: the name of the part and an index, if one value is at fault.
    pub path: Vec<String>,
    /// The invalid value; `None` if the value at `path` is it.
    pub value: Option<String>,
    /// The remedy.
    pub remedy: String,
}

impl fmt::Display for InvalidPart {
    /// The fault in one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        if let Some(value) = &self.value {
            write!(f, ": {value}")?;
        }
        write!(f, "; {}", self.remedy)
    }
}

impl std::error::Error for InvalidPart {}

pub(super) fn invalid(
    what: impl Into<String>,
    part: &str,
    index: Option<usize>,
    remedy: impl Into<String>,
) -> InvalidPart {
    let path = std::iter::once(part.to_owned()).chain(index.map(|index| index.to_string())).collect();
    InvalidPart { what: what.into(), path, value: None, remedy: remedy.into() }
}

impl InvalidPart {
    pub(super) fn value(self, value: impl Into<String>) -> Self {
        Self { value: Some(value.into()), ..self }
    }
}
