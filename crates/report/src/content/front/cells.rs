//! The cells of the small tables of the first page.

use super::measured::{Measured, Sample};
use crate::document::{Span, Text, text};

/// Maximum number of lines of a table.
pub(super) const LINES: usize = 12;

/// The rate without its sign; a dash without attempts.
pub(super) fn rate_of(sample: &Sample<'_>, rate: Measured) -> Text {
    if sample.attempted == 0 { text!["–"] } else { without_unit(rate.text()) }
}

/// A measured value whose unit the head of its column states.
pub(super) fn without_unit(text: Text) -> Text {
    let strip = |span| match span {
        Span::Plain(words) => Span::Plain(words.replace(" mm RMS", "").replace(" mm", "").replace(" %", "")),
        span => span,
    };
    text.into_iter().map(strip).collect()
}
