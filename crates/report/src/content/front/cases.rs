//! The answer over named cases: rates of fixes and errors, with the differences that their intervals show.

use super::{
    contrast::{Contrast, Ranked},
    kind::Asked,
    measured::{DistributionOf, Sample, capitalised, error, median_of, wrong},
    ranking::{Case, Words, clause, decreasing, of_attempts},
};
use crate::{
    content::{conditions::labels::Labels, phrases::Unit},
    document::{Text, text},
    field::Field,
    format::quoted,
    run::Run,
    summary::RunSummary,
};

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, asked: Asked) -> Option<Text> {
    let mut series = labels.series(summary);
    series.retain(|(_, members)| members.iter().any(|&index| summary.rows[index].attempted > 0));
    let mut clauses = Vec::new();
    if asked.rate {
        clauses.push(rates(run, summary, &series, asked)?);
    }
    if asked.points {
        let quantity = (Field::Identified, (|row| row.identified) as DistributionOf);
        let name = "median number of identified points of a fix";
        clauses.extend(medians(run, summary, &series, (name, quantity, MORE), (Unit::Plain, "")));
    }
    if asked.accuracy {
        let (name, field, of) = error(summary);
        let name = format!("median {name}");
        clauses.extend(medians(run, summary, &series, (&name, (field, of), FEWER), (Unit::Millimetres, " mm")));
    }
    let mut message = Text::new();
    for (index, clause) in clauses.into_iter().enumerate() {
        message.extend(text![if index > 0 { "; " } else { "" }]);
        message.extend(clause);
    }
    message.retain(|span| !span.plain().is_empty());
    if message.is_empty() {
        return None;
    }
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// The adjectives of a quantity that is better if it is larger.
const MORE: [&str; 3] = ["highest", "lowest", "lower"];
/// The adjectives of an error.
const FEWER: [&str; 3] = ["smallest", "largest", "larger"];

/// The words of a ranking.
fn words<'a>(quantity: &'a str, [best, worst, worse]: [&'static str; 3]) -> Words<'a> {
    Words { quantity, best, worst, worse }
}

/// The clause on the rates; `None` without attempts.
fn rates(run: &Run, summary: &RunSummary, series: &[(String, Vec<usize>)], asked: Asked) -> Option<Text> {
    let sample = |members: &[usize]| Sample::of(run, summary, members);
    let samples: Vec<Sample<'_>> = series.iter().map(|(_, members)| sample(members)).collect();
    let of = |(name, members): &(String, Vec<usize>)| Case {
        name: name.clone(),
        value: sample(members).measured(),
        members: members.clone(),
        tail: of_attempts(sample(members).n()),
    };
    let mut message = Text::new();
    match &samples[..] {
        [] => return None,
        [one] => {
            message.push("fixes succeed in ".into());
            message.extend(one.rate());
            message.extend(of_attempts(one.n()));
        }
        _ => {
            let cases = decreasing(series.iter().map(of).collect());
            let contrast = Contrast { run, summary };
            let differs = |a: &Case, b: &Case| contrast.rates_differ(&a.members, &b.members, cases.len());
            message.extend(clause(&cases, &words("rate of fixes", MORE), &differs));
            if asked.suffices {
                message.extend(against_first(run, summary, series));
            }
        }
    }
    Some(message)
}

/// The clause on the change of the rate from the first case to each other one, over their common attempts; empty if some
/// have none.
fn against_first(run: &Run, summary: &RunSummary, series: &[(String, Vec<usize>)]) -> Text {
    let contrast = Contrast { run, summary };
    let [(first, base), others @ ..] = series else { return Text::new() };
    let mut message = text![format!("; on the attempts in common with {}, it changes by ", quoted(first))];
    for (place, (name, members)) in others.iter().enumerate() {
        let Some(found) = contrast.of_rates(members, base, 0.95) else { return Text::new() };
        let [_, value, low, high] = contrast.numbers([members, base], "found", (found, Unit::Plain, 1));
        message.push(if place > 0 { ", by ".into() } else { "".into() });
        message.extend(text![value, if place > 0 { " [" } else { " points [" }, low, ", ", high]);
        message.push(format!("] with {}", quoted(name)).into());
    }
    message
}

/// The clause on the medians of a quantity over cases of one trial each; `None` without fixes.
fn medians(
    run: &Run,
    summary: &RunSummary,
    series: &[(String, Vec<usize>)],
    (name, (field, of), adjectives): (&str, Ranked, [&'static str; 3]),
    unit: (Unit, &'static str),
) -> Option<Text> {
    let single = series.iter().filter_map(|(name, members)| match members[..] {
        [index] if of(&summary.rows[index]).is_some() => Some((name.clone(), index)),
        _ => None,
    });
    let measured = single.map(|(name, index)| Case {
        name,
        value: median_of(summary, &run.trials[index], (field, of), unit),
        members: vec![index],
        tail: Text::new(),
    });
    let mut cases: Vec<Case> = measured.collect();
    // A value without an interval differs from none.
    if cases.iter().filter(|case| case.value.interval().is_some()).count() > 1 {
        cases.retain(|case| case.value.interval().is_some());
    }
    let mut cases = decreasing(cases);
    if adjectives == FEWER {
        cases.reverse();
    }
    if let [one] = &cases[..] {
        let mut message = text![format!("the {name} is ")];
        message.extend(one.value.text());
        return Some(message);
    }
    let contrast = Contrast { run, summary };
    let differs = |a: &Case, b: &Case| contrast.values_differ((field, of), [a, b], cases.len());
    (!cases.is_empty()).then(|| clause(&cases, &words(name, adjectives), &differs))
}
