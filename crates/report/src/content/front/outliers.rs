//! The answer about robust methods: the fraction of wrong pairs that each tolerates.

use super::measured::{capitalised, error, median, wrong};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        phrases,
        sections::breakdown::{self, Step},
    },
    document::{Text, text},
    format::{short, unit},
    number::Number,
    proportion::BORNE,
    run::Run,
    summary::RunSummary,
};

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let mut known: Vec<Borne> = Vec::new();
    for (name, members) in labels.series(summary) {
        let step = |&index: &usize| -> Option<Step<'_>> {
            Some((axes::on(&summary.rows[index], key)?, &summary.rows[index], &run.trials[index]))
        };
        let mut steps: Vec<Step<'_>> = members.iter().filter_map(step).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [point, surely] = ["percent", "low"].map(|end| breakdown::point(&steps, key, end).1);
        known.push((name, point, surely));
    }
    known.sort_by(|a, b| b.1.value.unwrap_or(-1.0).total_cmp(&a.1.value.unwrap_or(-1.0)));
    if known.is_empty() {
        return None;
    }
    let end = unit(key).map_or_else(String::new, |unit| format!(" {unit}"));
    let mut message = text![format!("at least {BORNE} % of the attempts have a fix ")];
    let same = |a: &Borne, b: &Borne| (a.1.value, a.2.value) == (b.1.value, b.2.value);
    for (place, group) in known.chunk_by(same).enumerate() {
        message.push(if place > 0 { ", " } else { "" }.into());
        let names = list(&group.iter().map(|borne| borne.0.as_str()).collect::<Vec<_>>());
        let (_, point, surely) = &group[0];
        if point.value.is_none() {
            message.push(format!("at none of the tested fractions with {names}").into());
            continue;
        }
        message.extend(text!["up to ", point.clone(), format!("{end} {} with {names}", short(key))]);
        // The interval states more than the rate only where its lower end is below the limit earlier.
        if surely.value.is_some() && surely.value != point.value {
            message.extend(text![
                " (surely to ",
                surely.clone(),
                format!("{end}, by the lower end of the 95 % interval)")
            ]);
        }
    }
    message.extend(at_the_largest(run, summary, labels, key).unwrap_or_default());
    message.extend(loss(run, summary, labels, key).unwrap_or_default());
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// A method, the largest fraction that it tolerates, and the same by the lower ends of the intervals.
type Borne = (String, Number, Number);

/// Names in a sentence: `a, b and c`.
fn list(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The clause on the highest and the lowest rate of fixes at the largest fraction.
fn at_the_largest(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let at = summary.rows.iter().filter_map(|row| axes::on(row, key)).reduce(f64::max)?;
    let rate = |index: usize| summary.rows[index].found as f64 / summary.rows[index].attempted as f64;
    let mut known: Vec<usize> = (0..summary.rows.len())
        .filter(|&index| axes::on(&summary.rows[index], key) == Some(at) && summary.rows[index].attempted > 0)
        .collect();
    known.sort_by(|&a, &b| rate(b).total_cmp(&rate(a)));
    let (best, worst) = (*known.first()?, *known.last()?);
    let percent = |index: usize| {
        let row = &summary.rows[index];
        phrases::percent(&run.trials[index], "found", row.found, row.attempted)
    };
    let series = |index: usize| labels.of_series(&summary.rows[index]);
    let mut message = text![format!("; at {} the attempts with a fix are ", labels.place(&summary.rows[best], key))];
    message.extend(text![percent(best), format!(" % with {}", series(best))]);
    if rate(worst) < rate(best) {
        message.extend(text![" and ", percent(worst), format!(" % with {}", series(worst))]);
    }
    Some(message)
}

/// The clause on the smallest and the largest median error at the smallest fraction.
fn loss(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let (name, _, of) = error(summary);
    let values = || summary.rows.iter().filter_map(|row| axes::on(row, key));
    let at = values().reduce(f64::min)?;
    let mut known: Vec<(usize, f64)> = (0..summary.rows.len())
        .filter(|&index| axes::on(&summary.rows[index], key) == Some(at))
        .filter_map(|index| Some((index, of(&summary.rows[index])?.median)))
        .collect();
    known.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (best, worst) = (known.first()?.0, known.last()?.0);
    let series = |index: usize| labels.of_series(&summary.rows[index]);
    let mut message = text![format!("; at {} the median {name} is from ", labels.place(&summary.rows[best], key))];
    message.extend(median(summary, &run.trials[best]));
    message.push(format!(" ({}) to ", series(best)).into());
    message.extend(median(summary, &run.trials[worst]));
    message.push(format!(" ({})", series(worst)).into());
    Some(message)
}
