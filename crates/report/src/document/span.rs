//! Formatted text.

use crate::number::Number;

/// A formatted text: a sequence of spans.
pub(crate) type Text = Vec<Span>;

/// A piece of text with one format.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Span {
    Plain(String),
    Italic(String),
    Bold(String),
    Code(String),
    Sub(String),
    Sup(String),
    Number(Number),
    /// A number that is significantly better than all others.
    Best(Number),
}

impl From<&str> for Span {
    fn from(text: &str) -> Self {
        Self::Plain(text.to_owned())
    }
}

impl From<String> for Span {
    fn from(text: String) -> Self {
        Self::Plain(text)
    }
}

impl From<Number> for Span {
    fn from(number: Number) -> Self {
        Self::Number(number)
    }
}

/// A text from pieces that convert to spans: `text!["of ", number, " frames"]`.
macro_rules! text {
    ($($piece:expr),* $(,)?) => { vec![$($crate::document::span::Span::from($piece)),*] };
}
pub(crate) use text;

pub(crate) fn italic(text: impl Into<String>) -> Span {
    Span::Italic(text.into())
}

pub(crate) fn bold(text: impl Into<String>) -> Span {
    Span::Bold(text.into())
}

pub(crate) fn code(text: impl Into<String>) -> Span {
    Span::Code(text.into())
}

pub(crate) fn sub(text: impl Into<String>) -> Span {
    Span::Sub(text.into())
}

pub(crate) fn sup(text: impl Into<String>) -> Span {
    Span::Sup(text.into())
}

impl Span {
    /// The unformatted text.
    pub(crate) fn plain(&self) -> &str {
        match self {
            Self::Plain(text)
            | Self::Italic(text)
            | Self::Bold(text)
            | Self::Code(text)
            | Self::Sub(text)
            | Self::Sup(text) => text,
            Self::Number(number) | Self::Best(number) => &number.text,
        }
    }

    /// The number; `None` for other spans.
    pub(crate) fn number(&self) -> Option<&Number> {
        match self {
            Self::Number(number) | Self::Best(number) => Some(number),
            _ => None,
        }
    }
}

/// The unformatted text of `text`.
pub(crate) fn plain_text(text: &[Span]) -> String {
    text.iter().map(Span::plain).collect()
}
