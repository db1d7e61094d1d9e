//! Answers that a person has written, with the values of their queries.

mod claims;
mod pairs;
mod printed;
mod trials;
mod value;

pub(crate) use claims::Checked;

use printed::shown;
use value::Values;

use crate::{
    answer::{Answer, AnswerError, Piece},
    document::Text,
    run::Run,
    summary::RunSummary,
};

/// A written answer with its values.
#[derive(Debug)]
pub(crate) struct Authored {
    /// The answer as it was written, by which a page records it.
    pub(crate) answer: Answer,
    pub(crate) text: Text,
    pub(crate) claims: Vec<Checked>,
}

impl Authored {
    /// Computes the values of an answer and of its claims.
    ///
    /// # Errors
    /// The first query that has no value in this run.
    pub(crate) fn of(answer: &Answer, run: &Run, summary: &RunSummary) -> Result<Self, AnswerError> {
        let values = Values { run, summary };
        let mut text = Text::new();
        for piece in &answer.pieces {
            match piece {
                Piece::Words(words) => text.push(words.clone().into()),
                Piece::Query(query) => {
                    text.extend(shown(values.expression(&query.expression, &query.text)?, query.shown, &query.text)?);
                }
            }
        }
        let claims = answer.claims.iter().map(|claim| values.check(claim)).collect::<Result<_, _>>()?;
        Ok(Self { answer: answer.clone(), text, claims })
    }

    /// One line for each claim that does not hold.
    pub(crate) fn unmet(&self) -> Vec<String> {
        let line = |checked: &Checked| {
            let values = crate::document::plain_text(&checked.values);
            format!(
                "the claim `{}` does not hold: {values}; change the claim, and the words of the answer",
                checked.claim
            )
        };
        self.claims.iter().filter(|checked| !checked.holds).map(line).collect()
    }
}
