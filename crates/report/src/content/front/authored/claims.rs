//! The claims of written answers, checked on the logs.

use super::{printed::shown, trials::Chosen, value::Values};
use crate::{
    answer::{AnswerError, Claim, Group, Part, Quantity, Relation, Selection, Side},
    content::front::contrast::{Contrast, simultaneous},
    document::{Text, text},
};

/// A claim with its values.
#[derive(Debug)]
pub(crate) struct Checked {
    /// The claim as it was written.
    pub(crate) claim: String,
    /// The values of both sides.
    pub(crate) values: Text,
    pub(crate) holds: bool,
}

impl Values<'_> {
    /// Computes both sides of a claim.
    pub(super) fn check(&self, claim: &Claim) -> Result<Checked, AnswerError> {
        let (values, holds) = match &claim.relation {
            Relation::Compared(sides, sign) => {
                let [(a, mut values), (b, other)] = [self.side(&sides[0])?, self.side(&sides[1])?];
                values.push(format!(" {} ", sign.text()).into());
                values.extend(other);
                (values, sign.holds(a, b))
            }
            Relation::Significant { is, quantity, selections, cases } => {
                let (values, significant) = self.significant(*quantity, selections, *cases, &claim.text)?;
                (values, significant == *is)
            }
        };
        Ok(Checked { claim: claim.text.clone(), values, holds })
    }

    /// The value of a side in its printed unit, and its text.
    fn side(&self, side: &Side) -> Result<(f64, Text), AnswerError> {
        match side {
            Side::Number(number) => Ok((*number, text![crate::format::trimmed(*number)])),
            Side::Query(query) => {
                let value = self.expression(&query.expression, &query.text)?;
                let number = match query.shown.part {
                    Part::Low => value.interval().map(|ends| ends[0]),
                    Part::High => value.interval().map(|ends| ends[1]),
                    Part::Value | Part::Interval => Some(value.value()),
                };
                // A missing end is a fault, which `shown` describes.
                let text = shown(value, query.shown, &query.text)?;
                Ok((number.unwrap_or(f64::NAN), text))
            }
        }
    }

    /// Whether a difference is significant among `cases` compared together, and the values of both sides.
    ///
    /// Complete trials are compared over their common attempts where they have them, others by their intervals.
    fn significant(
        &self,
        quantity: Quantity,
        selections: &[Selection; 2],
        cases: usize,
        place: &str,
    ) -> Result<(Text, bool), AnswerError> {
        let [a, b] =
            [Chosen::of(self.summary, &selections[0], place)?, Chosen::of(self.summary, &selections[1], place)?];
        let values = [self.of(quantity, &a, place)?, self.of(quantity, &b, place)?];
        let contrast = Contrast { run: self.run, summary: self.summary };
        let paired = match quantity {
            _ if a.is_partial() || b.is_partial() => None,
            Quantity::Rate(Group::Fixes) => contrast.of_rates(&a.members, &b.members, simultaneous(cases)),
            Quantity::Median(field) => contrast.of_values(field, &a.members, &b.members, simultaneous(cases)),
            _ => None,
        };
        let significant = paired.map_or_else(|| values[0].differs(&values[1]), |of| of.significant());
        let [mut message, other] = values.map(|value| value.text());
        message.push(" and ".into());
        message.extend(other);
        Ok((message, significant))
    }
}
