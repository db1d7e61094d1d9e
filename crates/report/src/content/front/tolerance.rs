//! The answer about the tolerance of distances: the one with the largest F1 score at the ends of the other condition.

use super::{
    contrast::Contrast,
    measured::{Sample, capitalised},
};
use crate::{
    content::{conditions::axes, figures::tolerance::Identified},
    document::{Text, text},
    format::{placed, trimmed, unit},
    number::{Key, Number},
    run::Run,
    summary::RunSummary,
};

pub(super) fn sentence(run: &Run, summary: &RunSummary, key: &str) -> Option<Text> {
    let other = axes::keys(summary).into_iter().find(|other| other != key);
    let at = |index: usize| other.as_ref().and_then(|other| axes::on(&summary.rows[index], other)).unwrap_or(0.0);
    let all: Vec<(usize, Identified)> =
        run.trials.iter().map(Identified::of).enumerate().filter_map(|(index, of)| Some((index, of?))).collect();
    let mut ends: Vec<f64> = all.iter().map(|(index, _)| at(*index)).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    if let [first, .., last] = ends[..] {
        ends = vec![first, last];
    }
    let mut message = Text::new();
    for end in ends {
        let here = || all.iter().filter(|(index, _)| at(*index) == end);
        let (index, identified) = here().max_by(|a, b| a.1.f1().total_cmp(&b.1.f1()))?;
        let (row, trial) = (&summary.rows[*index], &run.trials[*index]);
        let number = |over: &str, value: f64| {
            let what = format!("sum correct_pairs by {over}");
            Number::new(Some(value), 3, Key::of(trial, "/metrics/evaluation", what))
        };
        let condition =
            other.as_ref().map_or_else(String::new, |other| format!("at {} ", placed(other, &trimmed(end))));
        let tolerance = axes::on(row, key)?;
        message.extend(text![
            format!(
                "{}{condition}the identified points have the largest F1 score (of precision and recall) with {} and {}, at a precision of ",
                if message.is_empty() { "" } else { "; " },
                row.search,
                placed(key, &trimmed(tolerance))
            ),
            number("identified of fixes", identified.precision),
            " and a recall of ",
            number("visible", identified.recall),
            ", with fixes in "
        ]);
        let sample = Sample::of(run, summary, &[*index]);
        let best = sample.measured();
        message.extend(best.text());
        message.extend(text![" of ", sample.n(), " attempts"]);
        let search = |index: usize| &summary.rows[index].search;
        let others = here().filter(|(other, _)| other != index && search(*other) == search(*index));
        let others: Vec<usize> = others.map(|(other, _)| *other).collect();
        let contrast = Contrast { run, summary };
        let close = others.iter().filter(|&&other| !contrast.rates_differ(&[other], &[*index], others.len() + 1));
        let close: Vec<f64> = close.filter_map(|&other| axes::on(&summary.rows[other], key)).collect();
        message.extend(similar_tolerances(close, key));
    }
    (!message.is_empty()).then(|| capitalised(message))
}

/// The words on tolerances of the same search whose rates do not differ significantly; `None` without any.
fn similar_tolerances(mut close: Vec<f64>, key: &str) -> Option<crate::document::Span> {
    close.sort_by(f64::total_cmp);
    let unit = unit(key).map_or_else(String::new, |unit| format!(" {unit}"));
    let [first, .., last] = close[..] else {
        let one = trimmed(*close.first()?);
        return Some(format!(", a rate that does not differ significantly from that at {one}{unit}").into());
    };
    let (first, last) = (trimmed(first), trimmed(last));
    Some(
        format!(", a rate that does not differ significantly from those at {} other tolerances from {first} to {last}{unit}", close.len())
            .into(),
    )
}
