//! Answers that a person has written: words, and queries in braces whose values are computed from the logs.
//!
//! ```text
//! Up to {fix-rate: method=the defaults, altitude=5.5; interval} of the attempts have a fix.
//! ```
//!
//! This module has the syntax; `content::front::authored` computes the values. [docs/answers.md] lists quantities,
//! selections and options.
//!
//! [docs/answers.md]: https://github.com/seafix/seafix/blob/main/docs/answers.md

mod claim;
mod error;
mod quantity;
mod query;
mod quotes;
mod selection;
#[cfg(test)]
mod tests;

pub(crate) use claim::{Claim, Relation, Side};
pub use error::AnswerError;
pub(crate) use quantity::{Group, Quantity};
pub(crate) use query::{Expression, Extreme, Operation, Part, Query, Shown, Term};
pub(crate) use selection::{Condition, Selection};

/// A written answer with its claims.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    text: String,
    pub(crate) pieces: Vec<Piece>,
    pub(crate) claims: Vec<Claim>,
}

/// A piece of an answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Piece {
    Words(String),
    Query(Query),
}

impl Answer {
    /// Parses an answer, and the relations that its words assert.
    ///
    /// # Errors
    /// The first fault of a query or claim, as far as it is known without the logs.
    ///
    /// ```
    /// use seafix_report::Answer;
    /// let answer = Answer::parse("Yes, in {fix-rate: method=new} of the attempts.", &["fix-rate: method=new > 50"])?;
    /// assert!(Answer::parse("{fixrate: method=new}", &[""; 0]).unwrap_err().to_string().contains("did you mean `fix-rate`"));
    /// # Ok::<(), seafix_report::AnswerError>(())
    /// ```
    pub fn parse(text: &str, claims: &[impl AsRef<str>]) -> Result<Self, AnswerError> {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let mut pieces = Vec::new();
        let mut rest = text.as_str();
        while let Some((words, after)) = rest.split_once('{') {
            let Some((query, after)) = after.split_once('}').filter(|(query, _)| !query.contains('{')) else {
                return Err(AnswerError::new(&format!("{{{after}"), "no closing brace", "end each query with `}`"));
            };
            pieces.push(Piece::Words(words.to_owned()));
            pieces.push(Piece::Query(Query::parse(query.trim())?));
            rest = after;
        }
        if rest.contains('}') {
            return Err(AnswerError::new(rest, "no opening brace", "begin each query with `{`"));
        }
        pieces.push(Piece::Words(rest.to_owned()));
        pieces.retain(|piece| *piece != Piece::Words(String::new()));
        if pieces.is_empty() {
            return Err(AnswerError::new(&text, "an empty answer", "write a sentence, or leave `answer` out"));
        }
        let claims = claims.iter().map(|claim| Claim::parse(claim.as_ref())).collect::<Result<_, _>>()?;
        Ok(Self { text, pieces, claims })
    }

    /// The text with its queries.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The texts of the claims.
    pub(crate) fn claims(&self) -> impl Iterator<Item = &str> {
        self.claims.iter().map(|claim| claim.text.as_str())
    }
}
