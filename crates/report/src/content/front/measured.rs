//! Measured values with their intervals, as pieces of a sentence.

use crate::{
    content::phrases::{self, Unit},
    document::{Text, text},
    field::Field,
    run::{Run, Trial},
    summary::{Distribution, Row, RunSummary},
};

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

    /// The rate of fixes with its 95 % interval: `76.7 % [66.4, 85.2]`.
    pub(super) fn rate(&self) -> Text {
        let [percent, low, high] = phrases::pooled_rate(&self.trials, "found", (self.found, self.attempted));
        text![percent, " % [", low, ", ", high, "]"]
    }

    /// The number of attempts.
    pub(super) fn n(&self) -> crate::number::Number {
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
    let digits = phrases::decimals(summary.rows.iter().map(|row| of(row).map(|s| s.median)), Unit::Millimetres);
    let [median, low, high] = phrases::median(trial, field, (Unit::Millimetres, digits));
    text![median, " mm [", low, ", ", high, "]"]
}

/// The clause on the wrong fixes of a run: `; 1 wrong fix in 671 attempts`; empty without ground truth.
pub(super) fn wrong(run: &Run, summary: &RunSummary) -> Text {
    let all = Sample::of(run, summary, &(0..summary.rows.len()).collect::<Vec<_>>());
    if summary.rows.iter().all(|row| row.unjudged == row.found) && all.found > 0 {
        return Text::new();
    }
    let count = phrases::pooled_count(&all.trials, "wrong", all.wrong);
    text!["; ", count, if all.wrong == 1 { " wrong fix in " } else { " wrong fixes in " }, all.n(), " attempts"]
}

/// A text that begins with a capital letter.
pub(super) fn capitalised(mut text: Text) -> Text {
    if let Some(crate::document::Span::Plain(first)) = text.first_mut() {
        *first = crate::format::sentence_case(first);
    }
    text
}
