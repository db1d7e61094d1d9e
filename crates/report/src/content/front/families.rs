//! The answer about methods over kinds of problems: in which kinds each method is among the best, and how often it is wrong.

use super::{
    contrast::Contrast,
    measured::{Sample, capitalised},
    ranking::{Case, decreasing, names},
};
use crate::{
    content::conditions::labels::{Labels, value},
    document::{Text, text},
    format::{distinct, quoted},
    run::Run,
    summary::RunSummary,
};

/// The axis of the kinds of problems: the only one beside the methods that varies; `None` for another grid of trials.
pub(super) fn kinds(summary: &RunSummary, labels: &Labels) -> Option<String> {
    let first = summary.rows.first()?;
    let varies = |key: &str| summary.rows.iter().any(|row| value(row, key) != value(first, key));
    let mut others = first.axes.iter().map(|axis| &axis.key).filter(|key| !labels.apart.contains(key) && varies(key));
    let key = others.next()?.clone();
    let series = labels.series(summary);
    let count = distinct(summary.rows.iter().map(|row| value(row, &key))).len();
    let complete = series.len() > 1 && series.iter().all(|(_, members)| members.len() == count);
    (labels.along.is_none() && others.next().is_none() && complete).then_some(key)
}

/// The best rate in every kind, the kinds in which each method is significantly below it, and the wrong fixes.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, key: &str) -> Option<Text> {
    let kinds = distinct(summary.rows.iter().map(|row| value(row, key)));
    let contrast = Contrast { run, summary };
    let mut below: Vec<(String, Vec<String>)> =
        labels.series(summary).into_iter().map(|(name, _)| (name, Vec::new())).collect();
    let mut best = Text::new();
    for kind in &kinds {
        let members = (0..summary.rows.len()).filter(|&index| value(&summary.rows[index], key) == *kind);
        let case = |index: usize| Case {
            name: labels.of_series(&summary.rows[index]),
            value: Sample::of(run, summary, &[index]).measured(),
            members: vec![index],
            tail: Text::new(),
        };
        let cases = decreasing(members.map(case).collect());
        let first = cases.first()?;
        best.push(if best.is_empty() { "" } else { ", " }.into());
        best.extend(first.value.text());
        best.push(format!(" in {}", quoted(kind)).into());
        for case in &cases {
            let lower = case.value.value() < first.value.value();
            if lower && contrast.rates_differ(&case.members, &first.members, cases.len()) {
                let own = below.iter_mut().find(|(name, _)| *name == case.name);
                own.into_iter().for_each(|(_, kinds)| kinds.push(kind.clone()));
            }
        }
    }
    below.sort_by_key(|(_, kinds)| kinds.len());
    let mut message = Text::new();
    for group in below.chunk_by(|a, b| a.1 == b.1) {
        let own = names(group.iter().map(|(name, _)| name.as_str()));
        let verb = if group.len() == 1 { "is" } else { "are" };
        message.push(if message.is_empty() { "" } else { "; " }.into());
        message.push(match group[0].1.len() {
            0 => format!("{own} {verb} nowhere significantly below the best rate").into(),
            n if n == kinds.len() => format!("{own} {verb} below it everywhere").into(),
            _ => format!("{own} {verb} below it in {}", names(group[0].1.iter().map(String::as_str))).into(),
        });
    }
    message.push("; the best rates are ".into());
    message.extend(best);
    message.extend(wrong(run, summary, labels));
    Some(capitalised(message))
}

/// The rates of wrong fixes of all methods, the smallest first; those without any together.
fn wrong(run: &Run, summary: &RunSummary, labels: &Labels) -> Text {
    let series = labels.series(summary);
    let mut samples: Vec<(&str, Sample<'_>)> =
        series.iter().map(|(name, members)| (name.as_str(), Sample::of(run, summary, members))).collect();
    samples.sort_by_key(|(_, sample)| sample.wrong);
    let mut message = Text::new();
    for group in samples.chunk_by(|a, b| (a.1.wrong, a.1.attempted) == (b.1.wrong, b.1.attempted)) {
        let own = names(group.iter().map(|(name, _)| *name));
        let sample = &group[0].1;
        message.push(if message.is_empty() { "; wrong fixes: " } else { ", " }.into());
        message.extend(match sample.wrong {
            0 => text!["none of ", sample.n(), " attempts"],
            _ => text![sample.wrong_count(), " of ", sample.n()],
        });
        message.push(format!(" with {own}").into());
    }
    message
}
