//! Whether two cases of a run differ, by their common attempts where they have them.

use seafix_evaluation::Difference;

use super::{
    measured::{Sample, median_of},
    ranking::Case,
};
use crate::{
    content::phrases::{self, Unit},
    document::{Text, text},
    field::Field,
    number::Number,
    paired, proportion,
    run::{AttemptRow, Run, Trial},
    summary::{Distribution, Row, RunSummary},
};

/// Compares the cases of a run.
pub(super) struct Contrast<'a> {
    pub(super) run: &'a Run,
    pub(super) summary: &'a RunSummary,
}

impl Contrast<'_> {
    /// The difference of the rates of fixes, as fractions; `None` without common attempts.
    pub(super) fn of_rates(&self, a: &[usize], b: &[usize], confidence: f64) -> Option<Difference> {
        let found = |row: &AttemptRow| f64::from(u8::from(row.found()));
        let pairs: Vec<(bool, bool)> = self.pairs(a, b, found)?.into_iter().map(|(a, b)| (a > 0.5, b > 0.5)).collect();
        Some(Difference::of_rates(&pairs, self.block(a, pairs.len()), confidence))
    }

    /// The median difference of a quantity over the attempts in which both have a fix, or of the cost over all; `None`
    /// without any.
    pub(super) fn of_values(&self, field: Field, a: &[usize], b: &[usize], confidence: f64) -> Option<Difference> {
        let value =
            |row: &AttemptRow| row.get(field).filter(|_| row.found() || field == Field::Tests).unwrap_or(f64::NAN);
        let mut pairs = self.pairs(a, b, value)?;
        pairs.retain(|(a, b)| !a.is_nan() && !b.is_nan());
        Difference::of_values(&pairs, self.block(a, pairs.len()), confidence)
    }

    /// Whether the rates of fixes of two of `count` cases differ significantly, all comparisons with the best together.
    pub(super) fn rates_differ(&self, a: &[usize], b: &[usize], count: usize) -> bool {
        match self.of_rates(a, b, simultaneous(count)) {
            Some(difference) => difference.significant(),
            None => {
                let [a, b] = [a, b].map(|members| Sample::of(self.run, self.summary, members).measured());
                a.differs(&b)
            }
        }
    }

    /// Whether a quantity of two of `count` cases of one trial each differs significantly.
    pub(super) fn values_differ(&self, (field, of): Ranked, [a, b]: [&Case; 2], count: usize) -> bool {
        match self.of_values(field, &a.members, &b.members, simultaneous(count)) {
            Some(difference) => difference.significant(),
            None => {
                let [a, b] = [a, b].map(|case| {
                    median_of(self.summary, &self.run.trials[case.members[0]], (field, of), (Unit::Plain, ""))
                });
                a.differs(&b)
            }
        }
    }

    /// The words on the change of the rate of fixes from the first trial to the second; `None` without common attempts.
    pub(super) fn change_of_rate(&self, first: usize, second: usize) -> Option<Text> {
        let found = self.of_rates(&[second], &[first], 0.95)?;
        Some(self.words([&[second], &[first]], "found", (found, Unit::Plain, 1)))
    }

    /// The words on the change of a quantity (m) of the fixes from the first trial to the second.
    pub(super) fn change_of_value(&self, field: Field, first: usize, second: usize, digits: usize) -> Option<Text> {
        let found = self.of_values(field, &[second], &[first], 0.95)?;
        Some(self.words([&[second], &[first]], field.name(), (found, Unit::Millimetres, digits)))
    }

    /// ` (a change of −8.1 points [−24.0, 9.0] in 40 common attempts, not significant)`.
    fn words(&self, samples: [&[usize]; 2], what: &str, found: (Difference, Unit, usize)) -> Text {
        let [pairs, value, low, high] = self.numbers(samples, what, found);
        let unit = if what == "found" { " points" } else { " mm" };
        let common = if what == "found" { "common attempts" } else { "attempts with both fixes" };
        text![
            if what == "found" { " (a change of " } else { " (a median change of " },
            value,
            unit,
            " [",
            low,
            ", ",
            high,
            "] in ",
            pairs,
            format!(" {common}, {}significant)", if found.0.significant() { "" } else { "not " })
        ]
    }

    /// The number of pairs of a difference of two samples, its value and the ends of its interval, with their keys.
    pub(super) fn numbers(
        &self,
        [a, b]: [&[usize]; 2],
        what: &str,
        (found, unit, digits): (Difference, Unit, usize),
    ) -> [Number; 4] {
        let trials: Vec<&Trial> =
            a.iter().zip(b).flat_map(|(a, b)| [a, b]).map(|&index| &self.run.trials[index]).collect();
        let [low, high] = found.interval;
        // Rates are in points.
        let scale = if what == "found" { 100.0 } else { unit.scale() };
        let key = |name: &str, suffix: &str| {
            phrases::over(&trials, "/metrics/evaluation", format!("{name} {what} over pairs{suffix}"))
        };
        let number = |name: &str, value: f64| Number::new(Some(scale * value), digits, key(name, unit.suffix()));
        [
            Number::count(found.pairs.unwrap_or(0), key("pairs", "")),
            number("difference", found.value),
            number("difference-low", low),
            number("difference-high", high),
        ]
    }

    /// The values of the common attempts of the trials `a` and `b`, trial by trial.
    fn pairs(&self, a: &[usize], b: &[usize], of: impl Fn(&AttemptRow) -> f64) -> Option<Vec<(f64, f64)>> {
        let trial = |index: usize| -> &Trial { &self.run.trials[index] };
        let comparable = |(a, b): (&usize, &usize)| paired::comparable(self.run, trial(*a), trial(*b));
        if a.len() != b.len() || !a.iter().zip(b).all(comparable) {
            return None;
        }
        let pairs: Vec<(f64, f64)> =
            a.iter().zip(b).flat_map(|(a, b)| paired::values(trial(*a), trial(*b), &of)).collect();
        (!pairs.is_empty()).then_some(pairs)
    }

    /// The number of successive pairs of `n` that count as one.
    fn block(&self, members: &[usize], n: usize) -> usize {
        let trajectory = members.iter().any(|&index| proportion::is_trajectory(&self.run.trials[index].header));
        proportion::block(trajectory, n)
    }
}

/// The level of the intervals of the differences between the best of `count` cases and each other one.
///
/// All hold together with a probability of at least 95 % (Bonferroni).
pub(super) fn simultaneous(count: usize) -> f64 {
    1.0 - 0.05 / count.saturating_sub(1).max(1) as f64
}

/// A quantity of the fixes, and its distribution in a row.
pub(super) type Ranked = (Field, fn(&Row) -> Option<Distribution>);
