//! The values of written answers that two selections have: changes, common attempts, and values of two terms.

use std::collections::BTreeSet;

use super::{
    trials::Chosen,
    value::{Values, unit},
};
use crate::{
    answer::{AnswerError, Expression, Group, Operation, Quantity, Selection, Term},
    content::{
        front::{contrast::Contrast, measured::Measured},
        phrases::{self, Unit},
    },
    format,
    number::{Key, Number},
    paired, proportion,
    run::{AttemptRow, Frame, Trial},
};

impl Values<'_> {
    /// The value of an expression in the query `place`.
    pub(super) fn expression(&self, expression: &Expression, place: &str) -> Result<Measured, AnswerError> {
        match expression {
            Expression::Term(term) => self.term(term, place),
            Expression::Change(quantity, both) => self.change(*quantity, both, place),
            Expression::Common(quantity, both) => self.common(*quantity, both, place),
            Expression::Combined(operation, both) => self.combined(*operation, both, place),
        }
    }

    /// The two selections of a comparison; neither names a part of a trial.
    fn both(&self, [a, b]: &[Selection; 2], place: &str) -> Result<[Chosen; 2], AnswerError> {
        let both = [Chosen::of(self.summary, a, place)?, Chosen::of(self.summary, b, place)?];
        if both.iter().any(Chosen::is_partial) {
            return Err(AnswerError::new(place, "a comparison of parts of trials", "compare the complete trials"));
        }
        Ok(both)
    }

    /// The change of a rate (points) or of a quantity of the fixes, over the common attempts.
    fn change(&self, quantity: Quantity, both: &[Selection; 2], place: &str) -> Result<Measured, AnswerError> {
        let [a, b] = self.both(both, place)?;
        let contrast = Contrast { run: self.run, summary: self.summary };
        let (found, what, digits, (unit, sign)) = match quantity {
            Quantity::Rate(Group::Fixes) => {
                (contrast.of_rates(&a.members, &b.members, 0.95), "found", 1, (Unit::Plain, " points"))
            }
            Quantity::Median(field) => {
                (contrast.of_values(field, &a.members, &b.members, 0.95), field.name(), self.digits(field), unit(field))
            }
            _ => {
                return Err(AnswerError::new(
                    place,
                    "no change of this quantity",
                    "use fix-rate, or the median of a quantity",
                ));
            }
        };
        let found = found.ok_or_else(|| uncommon(place))?;
        let [_, value, low, high] = contrast.numbers([&a.members, &b.members], what, (found, unit, digits));
        Ok(Measured::new([value, low, high], sign))
    }

    /// A count, rate or median of the first trial over the attempts that it has in common with all others.
    fn common(&self, quantity: Quantity, both: &[Selection; 2], place: &str) -> Result<Measured, AnswerError> {
        let [own, others] = self.both(both, place)?;
        let ([index], quantity @ (Quantity::Rate(_) | Quantity::Count(_) | Quantity::Median(_))) =
            (&own.members[..], quantity)
        else {
            let remedy = "write common fix-rate: A & B with one trial in A; counts and medians likewise";
            return Err(AnswerError::new(place, "no common attempts of this", remedy));
        };
        let own = &self.run.trials[*index];
        let others: Vec<&Trial> =
            others.members.iter().filter(|other| *other != index).map(|&i| &self.run.trials[i]).collect();
        if others.is_empty() || others.iter().any(|other| !paired::comparable(self.run, own, other)) {
            return Err(uncommon(place));
        }
        let keyed = |(frame, row): (&Frame, &AttemptRow), trial: &Trial| (frame.number, trial.object(row).to_owned());
        let sets: Vec<BTreeSet<(u64, String)>> =
            others.iter().map(|trial| trial.attempts().map(|attempt| keyed(attempt, trial)).collect()).collect();
        let attempts = own.attempts().filter(|attempt| sets.iter().all(|set| set.contains(&keyed(*attempt, own))));
        let attempts: Vec<&AttemptRow> = attempts.map(|(_, row)| row).collect();
        let trials: Vec<&Trial> = [own].into_iter().chain(others).collect();
        let topic = "/metrics/evaluation";
        let key = |what: &str, of: &str, unit: Unit| {
            phrases::over(&trials, topic, format!("{what} {of} of common{}", unit.suffix()))
        };
        let trajectory = proportion::is_trajectory(&own.header);
        let group = match quantity {
            Quantity::Rate(group) | Quantity::Count(group) => group,
            Quantity::Median(field) => {
                let (unit, sign) = unit(field);
                let mut values: Vec<f64> =
                    attempts.iter().filter(|row| row.found()).filter_map(|row| row.get(field)).collect();
                let (low, high) =
                    proportion::median_interval(trajectory, &mut values).ok_or_else(|| uncommon(place))?;
                let median = seafix_evaluation::quantile(&mut values, 0.5);
                let number = |name: &str, value: f64| {
                    Number::new(Some(value * unit.scale()), self.digits(field), key(name, field.name(), unit))
                };
                let numbers = [number("median", median), number("median-low", low), number("median-high", high)];
                return Ok(Measured::new(numbers, sign).of_fixes(values.len()));
            }
            _ => return Err(uncommon(place)),
        };
        let is = |row: &&AttemptRow| match group {
            Group::Attempts => true,
            Group::Wrong => row.wrong(),
            _ => row.found(),
        };
        let key = |what: &str| key(what, group.key(), Unit::Plain);
        if let Quantity::Count(_) = quantity {
            return Ok(Measured::single(
                Number::count(attempts.iter().filter(|row| is(row)).count(), key("count")),
                "",
            ));
        }
        let events: Vec<bool> = attempts.iter().map(is).collect();
        let rate = proportion::rate(trajectory, &events).ok_or_else(|| uncommon(place))?;
        let number = |name: &str, value: f64| Number::new(Some(value), 1, key(name));
        Ok(Measured::new([number("percent", rate[0]), number("low", rate[1]), number("high", rate[2])], " %"))
    }

    /// A value computed from the unrounded values of two terms.
    fn combined(&self, operation: Operation, both: &[Term; 2], place: &str) -> Result<Measured, AnswerError> {
        let [a, b] = [self.term(&both[0], place)?, self.term(&both[1], place)?];
        let ([first, second], sign) = ([a.number(), b.number()], a.unit());
        if operation != Operation::Percent && operation != Operation::Ratio && sign != b.unit() {
            return Err(AnswerError::new(place, "two units", "take the difference of values of one unit"));
        }
        let value = operation.of(a.value(), b.value());
        if !value.is_finite() {
            return Err(AnswerError::new(place, "a division by zero", "divide by a value that is not zero"));
        }
        let [from, to] = [first.key.span, second.key.span];
        let logs: Vec<String> = first.key.logs.iter().chain(&second.key.logs).cloned().collect();
        let split = first.key.logs.len();
        let what = format!("combined {} {split} | {} | {}", operation.name(), first.key.what, second.key.what);
        let span = [from[0].min(to[0]), from[1].max(to[1])];
        let key = Key { what, topic: first.key.topic.clone(), span, logs };
        let (digits, sign) = match operation {
            Operation::Ratio => (format::decimals([value.abs()]), ""),
            Operation::Percent | Operation::Decrease => (1, " %"),
            Operation::Difference => (first.text.split_once('.').map_or(0, |(_, decimals)| decimals.len()), sign),
        };
        Ok(Measured::single(Number::new(Some(value), digits, key), sign))
    }
}

fn uncommon(place: &str) -> AnswerError {
    AnswerError::new(place, "no common attempts", "compare trials on the same frames, equally many on both sides")
}
