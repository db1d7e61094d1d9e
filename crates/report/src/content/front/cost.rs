//! The answer about the cost of searches: pair tests at the ends of the problem size.

use super::{
    contrast::Contrast,
    measured::{capitalised, counted_median as median},
    ranking::{self, Case, Words},
};
use crate::{
    content::conditions::{axes, labels::Labels},
    document::{Text, text},
    field::Field,
    format::placed,
    run::{Run, Trial},
    summary::RunSummary,
};

/// Every search at both ends of the sizes, the cheapest at the largest size first.
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
    let (_, first, last) = known.first().or(without.first())?;
    let candidates = |index: usize| median(&run.trials[index], Field::Candidates).number();
    let mut message = text![
        format!("from {} (a median of ", placed(key, &crate::format::trimmed(place(*first)))),
        candidates(*first),
        format!(" candidates) to {} (", placed(key, &crate::format::trimmed(largest))),
        candidates(*last),
        "), the median number of pair tests grows "
    ];
    for (index, (name, first, last)) in known.iter().enumerate() {
        message.extend(text![format!("{}from ", if index > 0 { ", " } else { "" }), tests(*first), " to "]);
        message.extend(median(&run.trials[*last], Field::Tests).text());
        message.push(format!(" with {name}").into());
    }
    for (index, (name, _, last)) in without.iter().enumerate() {
        let begin = if index == 0 { "; at their limit of work and without a fix there stop " } else { " and " };
        message.extend(text![
            format!("{begin}{name} after "),
            tests(*last),
            if index == 0 { " pair tests" } else { "" }
        ]);
    }
    Some(capitalised(message))
}

/// The ranking of the searches that have fixes at the largest size; `None` without two of them.
pub(super) fn conclusion(run: &Run, summary: &RunSummary) -> Option<Text> {
    let labels = Labels::of(summary);
    let key = labels.along.as_ref()?;
    let place = |index: usize| axes::on(&summary.rows[index], key).unwrap_or(f64::NEG_INFINITY);
    let largest = (0..summary.rows.len()).map(place).reduce(f64::max)?;
    let own = (0..summary.rows.len()).filter(|&index| place(index) == largest && summary.rows[index].found > 0);
    let case = |index: usize| Case {
        name: labels.of_series(&summary.rows[index]),
        value: median(&run.trials[index], Field::Tests),
        members: vec![index],
        tail: Text::new(),
    };
    let mut cases = ranking::decreasing(own.map(case).collect());
    cases.retain(|case| case.value.value() > 0.0);
    cases.reverse();
    let contrast = Contrast { run, summary };
    let differs = |a: &Case, b: &Case| contrast.values_differ((Field::Tests, |_| None), [a, b], cases.len());
    let words = Words { quantity: "number of pair tests", best: "smallest", worst: "largest", worse: "larger" };
    let mut message = text![format!("at {} ", placed(key, &crate::format::trimmed(largest)))];
    message.extend(ranking::clause(&cases, &words, &differs));
    message.push(" (in pairs of the same attempts).".into());
    (cases.len() > 1).then(|| capitalised(message))
}

/// The median number of pair tests of a trial.
pub(super) fn tests(trial: &Trial) -> Text {
    text![median(trial, Field::Tests).number()]
}
