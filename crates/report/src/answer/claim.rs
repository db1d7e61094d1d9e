//! The claims of written answers, without their values.

use super::{
    error::AnswerError,
    quantity::Quantity,
    query::{Query, compared},
    quotes::{split, split_once},
    selection::Selection,
};

/// A relation that the words of an answer assert.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Claim {
    /// The text as it was written.
    pub(crate) text: String,
    pub(crate) relation: Relation,
}

/// A relation of two values, or a verdict on their difference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Relation {
    Compared(Box<[Side; 2]>, Sign),
    Significant {
        /// Whether a significant difference is asserted, or none.
        is: bool,
        quantity: Quantity,
        selections: Box<[Selection; 2]>,
        /// The number of cases that are compared together: their intervals hold together with a probability of 95 %.
        cases: usize,
    },
}

/// A side of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Side {
    Query(Query),
    /// A number in the unit of the other side.
    Number(f64),
}

impl Eq for Side {}

/// The sign of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    Below,
    UpTo,
    Above,
    From,
    Equal,
}

/// The signs, those of two characters first.
const SIGNS: [(&str, Sign); 5] =
    [(" <= ", Sign::UpTo), (" >= ", Sign::From), (" < ", Sign::Below), (" > ", Sign::Above), (" = ", Sign::Equal)];

impl Sign {
    pub(crate) fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Self::Below => a < b,
            Self::UpTo => a <= b,
            Self::Above => a > b,
            Self::From => a >= b,
            Self::Equal => a == b,
        }
    }

    pub(crate) fn text(self) -> &'static str {
        SIGNS.iter().find(|(_, sign)| *sign == self).map_or("", |(text, _)| text.trim())
    }
}

impl Claim {
    /// Parses `QUERY < QUERY`, `QUERY = NUMBER`, `significant(QUANTITY: A - B)` or `not significant(QUANTITY: A - B; of N)`.
    pub(super) fn parse(text: &str) -> Result<Self, AnswerError> {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let (is, rest) = text.strip_prefix("not ").map_or((true, &text[..]), |rest| (false, rest));
        if let Some(rest) = rest.strip_prefix("significant(") {
            let relation = significant(is, rest, &text)?;
            return Ok(Self { relation, text });
        }
        let found = SIGNS.iter().find_map(|(sign, of)| split_once(&text, sign).map(|sides| (sides, *of)));
        let Some(((a, b), sign)) = found else {
            let remedy = "write QUERY < QUERY, QUERY = NUMBER, or significant(QUANTITY: A - B)";
            return Err(AnswerError::new(&text, "no relation", remedy));
        };
        let sides = Box::new([Side::parse(a)?, Side::parse(b)?]);
        Ok(Self { relation: Relation::Compared(sides, sign), text })
    }
}

impl Side {
    fn parse(text: &str) -> Result<Self, AnswerError> {
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Self::Number(number)),
            _ => Query::parse(text).map(Self::Query),
        }
    }
}

/// The claim on a difference, from the text after its opening parenthesis.
fn significant(is: bool, rest: &str, place: &str) -> Result<Relation, AnswerError> {
    let faulty = |what: &str| {
        AnswerError::new(place, what, "write significant(QUANTITY: A - B), or (QUANTITY: A - B; of N) with N cases")
    };
    let inside = rest.strip_suffix(')').ok_or_else(|| faulty("no closing parenthesis"))?;
    let (inside, cases) = match split(inside, ";")[..] {
        [one] => (one, 2),
        [one, of] => {
            let cases = of.strip_prefix("of ").and_then(|n| n.parse().ok()).filter(|n| *n > 1);
            (one, cases.ok_or_else(|| faulty("no number of cases"))?)
        }
        _ => return Err(faulty("several options")),
    };
    let (quantity, both) = compared(inside, " - ", place)?;
    Ok(Relation::Significant { is, quantity, selections: Box::new(both), cases })
}
