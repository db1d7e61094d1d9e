//! The answer about robust methods: the fraction of wrong pairs that each tolerates.

use super::measured::{capitalised, error, median, wrong};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        sections::breakdown::{self, Step},
    },
    document::{Text, text},
    format::{short, unit},
    proportion::BORNE,
    run::Run,
    summary::RunSummary,
};

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let mut known = Vec::new();
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
    let mut message = Text::new();
    for (name, point, surely) in known {
        let begin = if message.is_empty() { "" } else { "; " };
        if point.value.is_none() {
            message.push(format!("{begin}{name} tolerates none of the tested fractions").into());
            continue;
        }
        message.extend(text![
            format!("{begin}{name} tolerates {} of ", short(key)),
            point,
            unit(key).map_or_else(String::new, |unit| format!(" {unit}"))
        ]);
        if surely.value.is_some() {
            message.extend(text![" (", surely, " by the lower ends of the 95 % intervals)"]);
        }
    }
    if message.is_empty() {
        return None;
    }
    message.push(format!(", where at least {BORNE} % of the attempts have a fix").into());
    message.extend(loss(run, summary, labels, key).unwrap_or_default());
    message.extend(wrong(run, summary));
    Some(capitalised(message))
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
