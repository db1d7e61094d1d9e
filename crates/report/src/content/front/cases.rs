//! The answer over named cases: the highest and the lowest rate of fixes, the smallest and the largest error.

use super::{
    kind::Asked,
    measured::{Sample, capitalised, error, median, wrong},
};
use crate::{
    content::conditions::labels::Labels,
    document::{Text, text},
    run::Run,
    summary::RunSummary,
};

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, asked: Asked) -> Option<Text> {
    let mut series = labels.series(summary);
    series.retain(|(_, members)| members.iter().any(|&index| summary.rows[index].attempted > 0));
    let mut clauses = Vec::new();
    if asked.rate {
        clauses.push(rates(run, summary, &series)?);
    }
    if asked.accuracy {
        clauses.extend(errors(run, summary, &series));
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

/// The clause on the rates; `None` without attempts.
fn rates(run: &Run, summary: &RunSummary, series: &[(String, Vec<usize>)]) -> Option<Text> {
    let samples: Vec<(&str, Sample<'_>)> =
        series.iter().map(|(name, members)| (name.as_str(), Sample::of(run, summary, members))).collect();
    let fractions = || samples.iter().map(|(_, sample)| sample.fraction());
    let (high, low) = (fractions().reduce(f64::max)?, fractions().reduce(f64::min)?);
    let first = |fraction: f64| samples.iter().find(|(_, sample)| sample.fraction() == fraction);
    let (_, best) = first(high)?;
    if samples.len() == 1 {
        let mut message = text!["fixes succeed in "];
        message.extend(best.rate());
        message.extend(text![" of ", best.n(), " attempts"]);
        return Some(message);
    }
    if high == low {
        let mut message = text![format!("all {} cases have the same rate of fixes, ", samples.len())];
        message.extend(best.rate());
        message.extend(text![" of ", best.n(), " attempts each"]);
        return Some(message);
    }
    let (_, worst) = first(low)?;
    let names = |fraction: f64| {
        let own: Vec<String> =
            samples.iter().filter(|(_, sample)| sample.fraction() == fraction).map(|(name, _)| quoted(name)).collect();
        match &own[..] {
            [] => String::new(),
            [one] => format!("that of {one}"),
            // As many as one reads at a glance.
            [first @ .., last] if own.len() <= 4 => format!("that of {} and of {last}", first.join(", of ")),
            [one, ..] => format!("that of {one} and {} others", own.len() - 1),
        }
    };
    let mut message = text!["the highest rate of fixes, "];
    message.extend(best.rate());
    message.extend(text![" of ", best.n(), format!(" attempts, is {}, and the lowest, ", names(high))]);
    message.extend(worst.rate());
    message.extend(text![" of ", worst.n(), format!(", {}", names(low))]);
    Some(message)
}

/// A name in a sentence: one of several words in quotation marks, so that it is read as one.
fn quoted(name: &str) -> String {
    if name.contains(' ') { format!("“{name}”") } else { name.to_owned() }
}

/// The clause on the median errors of cases of one trial each; `None` without fixes.
fn errors(run: &Run, summary: &RunSummary, series: &[(String, Vec<usize>)]) -> Option<Text> {
    let (name, _, of) = error(summary);
    let single = series.iter().filter_map(|(name, members)| match members[..] {
        [index] => Some((name.as_str(), index, of(&summary.rows[index])?.median)),
        _ => None,
    });
    let known: Vec<(&str, usize, f64)> = single.collect();
    let smallest = known.iter().min_by(|a, b| a.2.total_cmp(&b.2))?;
    let largest = known.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
    let measured = |index: usize| median(summary, &run.trials[index]);
    if known.len() == 1 {
        let mut message = text![format!("the median {name} is ")];
        message.extend(measured(smallest.1));
        return Some(message);
    }
    let mut message = text![format!("the median {name} ranges from ")];
    message.extend(measured(smallest.1));
    message.push(format!(" ({}) to ", smallest.0).into());
    message.extend(measured(largest.1));
    message.push(format!(" ({})", largest.0).into());
    Some(message)
}
