//! The answer about robust methods: the fraction of wrong pairs that each tolerates.

use super::{
    contrast::Contrast,
    measured::{Sample, capitalised, error, median_of, wrong},
    ranking::{self, Case, Words},
};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        phrases::Unit,
        sections::breakdown::{self, Step},
    },
    document::{Text, text},
    format::{short, trimmed, unit},
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
        let names = ranking::names(group.iter().map(|borne| borne.0.as_str()));
        let (_, point, surely) = &group[0];
        if point.value.is_none() {
            message.push(format!("at none of the tested fractions with {names}").into());
            continue;
        }
        message.extend(text!["up to ", point.clone(), format!("{end} {} with {names}", short(key))]);
        // The interval states more than the rate only where its lower end is below the limit earlier.
        if surely.value.is_some() && surely.value != point.value {
            message.extend(text![
                " (up to ",
                surely.clone(),
                format!("{end} if the 95 % interval is to lie above this rate)")
            ]);
        }
    }
    message.extend(at_the_largest(run, summary, labels, key).unwrap_or_default());
    let values = || summary.rows.iter().filter_map(|row| axes::on(row, key));
    for at in [values().reduce(f64::min), values().reduce(f64::max)].into_iter().flatten() {
        message.extend(loss(run, summary, labels, (key, at)).unwrap_or_default());
    }
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// A method, the largest fraction that it tolerates, and the same by the lower ends of the intervals.
type Borne = (String, Number, Number);

/// The clause on the rates of fixes at the largest fraction.
fn at_the_largest(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let at = summary.rows.iter().filter_map(|row| axes::on(row, key)).reduce(f64::max)?;
    let known = (0..summary.rows.len())
        .filter(|&index| axes::on(&summary.rows[index], key) == Some(at) && summary.rows[index].attempted > 0);
    let cases = known.map(|index| Case {
        name: labels.of_series(&summary.rows[index]),
        value: Sample::of(run, summary, &[index]).measured(),
        members: vec![index],
        tail: Text::new(),
    });
    let cases = ranking::decreasing(cases.collect());
    if cases.len() < 2 {
        return None;
    }
    let words = Words { quantity: "rate of fixes", best: "highest", worst: "lowest", worse: "lower" };
    let mut message = text![format!("; at {} ", fraction(&trimmed(at), key))];
    let contrast = Contrast { run, summary };
    let differs = |a: &Case, b: &Case| contrast.rates_differ(&a.members, &b.members, cases.len());
    message.extend(ranking::clause(&cases, &words, &differs));
    Some(message)
}

/// A value of the fraction with its unit: `95 % outliers`.
fn fraction(value: &str, key: &str) -> String {
    let unit = unit(key).map_or_else(String::new, |unit| format!(" {unit}"));
    format!("{value}{unit} {}", short(key))
}

/// The clause on the median errors at a fraction.
fn loss(run: &Run, summary: &RunSummary, labels: &Labels, (key, at): (&str, f64)) -> Option<Text> {
    let (name, field, of) = error(summary);
    let known = (0..summary.rows.len()).filter(|&index| axes::on(&summary.rows[index], key) == Some(at));
    let cases = known.filter(|&index| of(&summary.rows[index]).is_some()).map(|index| Case {
        name: labels.of_series(&summary.rows[index]),
        value: median_of(summary, &run.trials[index], (field, of), (Unit::Millimetres, " mm")),
        members: vec![index],
        tail: Text::new(),
    });
    let mut cases = ranking::decreasing(cases.collect());
    cases.reverse();
    if cases.len() < 2 {
        return None;
    }
    let quantity = format!("median {name}");
    let words = Words { quantity: &quantity, best: "smallest", worst: "largest", worse: "larger" };
    let mut message = text![format!("; at {} ", fraction(&trimmed(at), key))];
    let contrast = Contrast { run, summary };
    let differs = |a: &Case, b: &Case| contrast.values_differ((field, of), [a, b], cases.len());
    message.extend(ranking::clause(&cases, &words, &differs));
    Some(message)
}
