//! Measured values with their intervals, as pieces of a sentence.

use seafix_evaluation::Difference;

use crate::{
    content::{
        phrases::{self, Unit},
        sections::navigation,
    },
    document::{Text, text},
    field::Field,
    format::counted,
    navigation_quantity::NavigationQuantity,
    number::Number,
    proportion,
    run::{Run, Trial},
    summary::{Distribution, Row, RunSummary},
};

/// Minimum number of values of a median with an interval: all of five lie on one side of it with probability 2 · 2⁻⁵,
/// above 5 %.
const MIN_FIXES: usize = 6;

/// A measured value with its 95 % interval.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    value: Number,
    /// The ends of the interval; unknown for a value without one.
    ends: [Number; 2],
    unit: &'static str,
    /// The words that stand in place of the interval.
    without: String,
}

impl Measured {
    /// The value with the ends of its interval, in a unit with the space before it, such as ` %`.
    pub(super) fn new([value, low, high]: [Number; 3], unit: &'static str) -> Self {
        Self { value, ends: [low, high], unit, without: String::new() }
    }

    /// A value without an interval.
    pub(super) fn single(value: Number, unit: &'static str) -> Self {
        let unknown = Number { value: None, ..value.clone() };
        Self::new([value, unknown.clone(), unknown], unit)
    }

    /// A median of `count` fixes, whose number stands in place of the interval if it is small.
    pub(super) fn of_fixes(self, count: usize) -> Self {
        let without = if count < MIN_FIXES { counted(count, "fix", "fixes") } else { String::new() };
        Self { without, ..self }
    }

    /// The same with another unit.
    pub(super) fn with_unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// The same with another number, such as the same value under another key.
    pub(super) fn with_number(self, value: Number) -> Self {
        Self { value, ..self }
    }

    /// The unit with the space before it.
    pub(super) fn unit(&self) -> &'static str {
        self.unit
    }

    /// The numbers at the ends of the interval; unknown for a value without one.
    pub(super) fn ends(&self) -> [Number; 2] {
        self.ends.clone()
    }

    /// Whether an interval, or words in its place, follow the value in a text.
    pub(super) fn has_ends(&self) -> bool {
        self.interval().is_some() || !self.without.is_empty()
    }

    /// The value before rounding, in its unit; NaN where it is unknown.
    pub(super) fn value(&self) -> f64 {
        self.value.value.unwrap_or(f64::NAN)
    }

    /// The value alone.
    pub(super) fn number(&self) -> Number {
        self.value.clone()
    }

    /// The ends of the interval, in its unit; `None` for a value without an interval.
    pub(super) fn interval(&self) -> Option<[f64; 2]> {
        Some([self.ends[0].value?, self.ends[1].value?]).filter(|_| self.without.is_empty())
    }

    /// Whether the difference of two independent values is significant; a value without an interval differs from none.
    pub(super) fn differs(&self, other: &Self) -> bool {
        let [Some(a), Some(b)] = [self, other].map(Self::with_ends) else { return false };
        Difference::of_independent(a, b).significant()
    }

    /// The value with the ends of its interval, in its unit; `None` for a value without an interval.
    pub(super) fn with_ends(&self) -> Option<[f64; 3]> {
        let [low, high] = self.interval()?;
        Some([self.value(), low, high])
    }

    /// The value with its interval: `76.7 % [66.4, 85.2]`.
    pub(super) fn text(&self) -> Text {
        let [low, high] = &self.ends;
        let mut message = text![self.value.clone(), self.unit];
        match self.interval() {
            Some(_) => message.extend(text![" [", low.clone(), ", ", high.clone(), "]"]),
            None if !self.without.is_empty() => message.push(format!(" ({})", self.without).into()),
            None => {}
        }
        message
    }
}

/// The trials at `members` as one sample.
pub(super) struct Sample<'a> {
    pub(super) trials: Vec<&'a Trial>,
    pub(super) found: usize,
    pub(super) wrong: usize,
    pub(super) attempted: usize,
}

impl<'a> Sample<'a> {
    pub(super) fn of(run: &'a Run, summary: &RunSummary, members: &[usize]) -> Self {
        let total = |of: fn(&Row) -> usize| members.iter().map(|&index| of(&summary.rows[index])).sum::<usize>();
        Self {
            trials: members.iter().map(|&index| &run.trials[index]).collect(),
            found: total(|row| row.found),
            wrong: total(|row| row.wrong),
            attempted: total(|row| row.attempted),
        }
    }

    /// The fraction of attempts with a fix; zero without attempts.
    pub(super) fn fraction(&self) -> f64 {
        self.found as f64 / self.attempted.max(1) as f64
    }

    /// The rate of fixes.
    pub(super) fn measured(&self) -> Measured {
        Measured::new(phrases::pooled_rate(&self.trials, "found", (self.found, self.attempted)), " %")
    }

    /// The rate of wrong fixes among the attempts.
    pub(super) fn wrong_rate(&self) -> Measured {
        Measured::new(phrases::pooled_rate(&self.trials, "wrong", (self.wrong, self.attempted)), " %")
    }

    /// The rate of fixes with its 95 % interval: `76.7 % [66.4, 85.2]`.
    pub(super) fn rate(&self) -> Text {
        self.measured().text()
    }

    /// The number of wrong fixes.
    pub(super) fn wrong_count(&self) -> Number {
        phrases::pooled_count(&self.trials, "wrong", self.wrong)
    }

    /// The number of attempts.
    pub(super) fn n(&self) -> Number {
        phrases::pooled_count(&self.trials, "attempted", self.attempted)
    }
}

/// The distribution of a quantity in a row; `None` where it is unknown.
pub(super) type DistributionOf = fn(&Row) -> Option<Distribution>;

/// The quantity that an answer about accuracy states: the camera position error, or the TRE of runs without it.
pub(super) fn error(summary: &RunSummary) -> (&'static str, Field, DistributionOf) {
    if summary.rows.iter().any(|row| row.position_error.is_some()) {
        ("camera position error", Field::Position, |row| row.position_error)
    } else {
        ("target registration error (TRE)", Field::Tre, |row| row.tre)
    }
}

/// The median error of a trial with its 95 % interval: `1.2 mm [1.0, 1.5]`.
pub(super) fn median(summary: &RunSummary, trial: &Trial) -> Text {
    let (_, field, of) = error(summary);
    median_of(summary, trial, (field, of), (Unit::Millimetres, " mm")).text()
}

/// The median of a quantity over the fixes of a trial; too few fixes are named in place of an interval.
pub(super) fn median_of(
    summary: &RunSummary,
    trial: &Trial,
    (field, of): (Field, DistributionOf),
    (unit, suffix): (Unit, &'static str),
) -> Measured {
    let digits = phrases::decimals(summary.rows.iter().map(|row| of(row).map(|s| s.median)), unit);
    median_with(trial, field, (unit, digits), suffix)
}

/// The median of a quantity over the fixes of a trial, with a number of decimals; too few fixes are named in place of an
/// interval.
pub(super) fn median_with(trial: &Trial, field: Field, unit: (Unit, usize), suffix: &'static str) -> Measured {
    let count = trial.attempts().filter(|(_, row)| row.found() && row.get(field).is_some()).count();
    Measured::new(phrases::median(trial, field, unit), suffix).of_fixes(count)
}

/// The median of a count over all attempts of a trial.
pub(super) fn counted_median(trial: &Trial, field: Field) -> Measured {
    let mut values: Vec<f64> = trial.attempts().filter_map(|(_, row)| row.get(field)).collect();
    let interval = proportion::median_interval(proportion::is_trajectory(&trial.header), &mut values);
    let median = interval.map(|_| seafix_evaluation::quantile(&mut values, 0.5));
    let ends = [interval.map(|ends| ends.0), interval.map(|ends| ends.1)];
    let number = |name, value| phrases::statistic(trial, name, field, "attempted", value, (Unit::Plain, 0));
    Measured::new([number("median", median), number("median-low", ends[0]), number("median-high", ends[1])], "")
}

/// The root mean square of a navigated error over the frames of a part of a trial.
pub(super) fn navigated_rms(trial: &Trial, quantity: NavigationQuantity, span: [u64; 2]) -> Measured {
    Measured::new(navigation::rms(trial, quantity, span), " mm RMS")
}

/// The clause on the wrong fixes of a run: `; 1 wrong fix in 671 attempts`; empty without ground truth.
pub(super) fn wrong(run: &Run, summary: &RunSummary) -> Text {
    let all = Sample::of(run, summary, &(0..summary.rows.len()).collect::<Vec<_>>());
    if summary.rows.iter().all(|row| row.unjudged == row.found) && all.found > 0 {
        return Text::new();
    }
    text![
        "; ",
        all.wrong_count(),
        if all.wrong == 1 { " wrong fix in " } else { " wrong fixes in " },
        all.n(),
        " attempts"
    ]
}

/// A text that begins with a capital letter.
pub(super) fn capitalised(mut text: Text) -> Text {
    if let Some(crate::document::Span::Plain(first)) = text.first_mut() {
        *first = crate::format::sentence_case(first);
    }
    text
}
