//! The answer about the cost of searches: pair tests at the ends of the problem size.

use super::measured::{Measured, capitalised};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        phrases::{self, Unit},
    },
    document::{Text, text},
    field::Field,
    proportion,
    run::{Run, Trial},
    summary::RunSummary,
};

/// The cheapest and the dearest search at the largest size, each at both ends of the sizes.
///
/// A search without a fix at the largest size ends at its limit of work, which says nothing about its growth: it is named.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let key = labels.along.as_ref()?;
    let place = |index: usize| axes::on(&summary.rows[index], key).unwrap_or(f64::INFINITY);
    let tests = |index: usize| median(&run.trials[index], Field::Tests).number();
    let mut known: Vec<(String, usize, usize)> = Vec::new();
    for (name, mut members) in labels.series(summary) {
        members.retain(|&index| tests(index).value.is_some_and(|tests| tests > 0.0));
        members.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
        if let [first, .., last] = members[..] {
            known.push((name, first, last));
        }
    }
    let largest = known.iter().map(|(_, _, last)| place(*last)).reduce(f64::max)?;
    known.retain(|(_, _, last)| place(*last) == largest);
    let (mut known, without): (Vec<_>, Vec<_>) =
        known.into_iter().partition(|(_, _, last)| summary.rows[*last].found > 0);
    known.sort_by(|a, b| tests(a.2).value.unwrap_or(0.0).total_cmp(&tests(b.2).value.unwrap_or(0.0)));
    let dearest = if known.len() > 1 { known.pop() } else { None };
    let cheapest = known.into_iter().next();
    let (_, first, last) = cheapest.as_ref()?;
    let candidates = |index: usize| median(&run.trials[index], Field::Candidates).number();
    let mut message = text![
        "from a median of ",
        candidates(*first),
        " candidates to one of ",
        candidates(*last),
        ", the median number of pair tests grows "
    ];
    for (index, (name, first, last)) in cheapest.into_iter().chain(dearest).enumerate() {
        message.push(format!("{}from ", if index > 0 { ", and " } else { "" }).into());
        message.extend(median(&run.trials[first], Field::Tests).text());
        message.push(" to ".into());
        message.extend(median(&run.trials[last], Field::Tests).text());
        message.push(format!(" with {name}").into());
    }
    for (name, _, last) in &without {
        message.extend(text![format!("; {name} has no fix there after "), tests(*last), " pair tests"]);
    }
    Some(capitalised(message))
}

/// The median of a count over all attempts of a trial.
fn median(trial: &Trial, field: Field) -> Measured {
    let mut values: Vec<f64> = trial.attempts().filter_map(|(_, row)| row.get(field)).collect();
    let interval = proportion::median_interval(proportion::is_trajectory(&trial.header), &mut values);
    let median = interval.map(|_| seafix_evaluation::quantile(&mut values, 0.5));
    let ends = [interval.map(|ends| ends.0), interval.map(|ends| ends.1)];
    let number = |name, value| phrases::statistic(trial, name, field, "attempted", value, (Unit::Plain, 0));
    Measured::new([number("median", median), number("median-low", ends[0]), number("median-high", ends[1])], "")
}
