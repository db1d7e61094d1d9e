//! The queries of written answers, without their values.

use super::{
    error::AnswerError,
    quantity::Quantity,
    quotes::{split, split_once},
    selection::Selection,
};

/// A query: what is computed, and how it is printed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Query {
    /// The text as it was written.
    pub(crate) text: String,
    pub(crate) expression: Expression,
    pub(crate) shown: Shown,
}

/// What a query computes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Expression {
    /// A quantity of the selected trials.
    Term(Term),
    /// The change of a quantity from the second selection to the first, over their common attempts.
    Change(Quantity, [Selection; 2]),
    /// A quantity of the first selection over the attempts that both selections have in common.
    Common(Quantity, [Selection; 2]),
    /// A value computed from two terms.
    Combined(Operation, Box<[Term; 2]>),
}

/// A quantity of the selected trials, or its extreme over them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Term {
    pub(crate) extreme: Option<Extreme>,
    pub(crate) quantity: Quantity,
    pub(crate) selection: Selection,
}

/// The trial that is chosen among several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extreme {
    Smallest,
    Largest,
}

/// An operation on two values a and b.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operation {
    /// a / b.
    Ratio,
    /// 100 a / b.
    Percent,
    /// 100 (a − b) / a.
    Decrease,
    /// a − b.
    Difference,
}

/// What of a value is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Shown {
    pub(crate) part: Part,
    /// Whether the unit is left to the words of the answer.
    pub(crate) bare: bool,
}

/// A value, its interval, or an end of its interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Part {
    #[default]
    Value,
    Interval,
    Low,
    High,
}

impl Operation {
    pub(crate) const ALL: [Self; 4] = [Self::Ratio, Self::Percent, Self::Decrease, Self::Difference];

    /// The name in queries and in keys.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Ratio => "ratio",
            Self::Percent => "percent",
            Self::Decrease => "decrease",
            Self::Difference => "difference",
        }
    }

    /// The sign between both terms.
    fn sign(self) -> &'static str {
        match self {
            Self::Ratio | Self::Percent => " / ",
            Self::Decrease | Self::Difference => " - ",
        }
    }

    /// The value; infinite or NaN for a divisor of zero.
    pub(crate) fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Ratio => a / b,
            Self::Percent => 100.0 * a / b,
            Self::Decrease => 100.0 * (a - b) / a,
            Self::Difference => a - b,
        }
    }
}

impl Query {
    /// Parses the text between two braces, or a side of a claim.
    pub(super) fn parse(text: &str) -> Result<Self, AnswerError> {
        let mut parts = split(text, ";").into_iter();
        let expression = Expression::parse(parts.next().unwrap_or(""), text)?;
        let mut shown = Shown::default();
        for option in parts {
            match option {
                "interval" => shown.part = Part::Interval,
                "low" => shown.part = Part::Low,
                "high" => shown.part = Part::High,
                "bare" => shown.bare = true,
                _ => {
                    let remedy = "there are interval, low, high and bare";
                    return Err(AnswerError::new(text, format!("unknown option `{option}`"), remedy));
                }
            }
        }
        Ok(Self { text: text.to_owned(), expression, shown })
    }
}

impl Expression {
    fn parse(text: &str, place: &str) -> Result<Self, AnswerError> {
        let (first, rest) = text.split_once(' ').unwrap_or((text, ""));
        if let Some(operation) = Operation::ALL.into_iter().find(|operation| operation.name() == first) {
            let [a, b] = two(rest, operation.sign(), place)?;
            return Ok(Self::Combined(operation, Box::new([Term::parse(a, place)?, Term::parse(b, place)?])));
        }
        match first {
            "change" => compared(rest, " - ", place).map(|(quantity, both)| Self::Change(quantity, both)),
            "common" => compared(rest, " & ", place).map(|(quantity, both)| Self::Common(quantity, both)),
            _ => Term::parse(text, place).map(Self::Term),
        }
    }
}

impl Term {
    fn parse(text: &str, place: &str) -> Result<Self, AnswerError> {
        let (extreme, text) = match text.split_once(' ') {
            Some(("smallest", rest)) => (Some(Extreme::Smallest), rest),
            Some(("largest", rest)) => (Some(Extreme::Largest), rest),
            _ => (None, text),
        };
        let (quantity, selection) = of_trials(text, place)?;
        let (quantity, selection) = (Quantity::parse(quantity, place)?, Selection::parse(selection, place)?);
        Ok(Self { extreme, quantity, selection })
    }
}

/// A quantity and two selections: `QUANTITY: A - B`.
pub(super) fn compared(text: &str, sign: &str, place: &str) -> Result<(Quantity, [Selection; 2]), AnswerError> {
    let (quantity, both) = of_trials(text, place)?;
    let [a, b] = two(both, sign, place)?;
    Ok((Quantity::parse(quantity, place)?, [Selection::parse(a, place)?, Selection::parse(b, place)?]))
}

/// The quantity and the selection around the colon.
fn of_trials<'a>(text: &'a str, place: &str) -> Result<(&'a str, &'a str), AnswerError> {
    split_once(text, ":").ok_or_else(|| {
        AnswerError::new(place, "no selection of trials", "write QUANTITY: AXIS=VALUE, or QUANTITY: all")
    })
}

/// The two sides of a sign.
fn two<'a>(text: &'a str, sign: &str, place: &str) -> Result<[&'a str; 2], AnswerError> {
    match split(text, sign)[..] {
        [a, b] => Ok([a, b]),
        _ => {
            let what = format!("not two sides of `{}`", sign.trim());
            Err(AnswerError::new(place, what, format!("write A{sign}B; put a value with this sign in double quotes")))
        }
    }
}
