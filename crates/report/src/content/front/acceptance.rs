//! The answer about the limit of the probability of a wrong answer: fixes and wrong fixes at each value.

use super::measured::{Measured, Sample, capitalised};
use crate::{
    content::conditions::labels::value,
    document::{Text, text},
    format::distinct,
    run::Run,
    summary::RunSummary,
};

/// Each value of the axis `key` with its trials, in the order of the run.
pub(super) fn limits(summary: &RunSummary, key: &str) -> Vec<(String, Vec<usize>)> {
    let members = |limit: &String| {
        (0..summary.rows.len()).filter(|&index| value(&summary.rows[index], key) == *limit).collect::<Vec<usize>>()
    };
    distinct(summary.rows.iter().map(|row| value(row, key)))
        .into_iter()
        .map(|limit| (limit.clone(), members(&limit)))
        .collect()
}

/// The rates of fixes and of wrong fixes at each value, and whether those of neighbours differ.
pub(super) fn sentence(run: &Run, summary: &RunSummary, key: &str) -> Option<Text> {
    let mut message = Text::new();
    let mut known: Vec<(String, [Measured; 2])> = Vec::new();
    for (limit, members) in limits(summary, key) {
        let sample = Sample::of(run, summary, &members);
        if sample.attempted == 0 {
            continue;
        }
        let [fixes, wrong] = [sample.measured(), sample.wrong_rate()];
        message.push(format!("{}at the limit {limit}, ", if message.is_empty() { "" } else { "; " }).into());
        message.extend(fixes.text());
        message.extend(text![" of ", sample.n(), " attempts have a fix and "]);
        message.extend(wrong.text());
        message.push(" a wrong one".into());
        known.push((limit, [fixes, wrong]));
    }
    message.extend(compared(&known).map(Into::into));
    (!message.is_empty()).then(|| capitalised(message))
}

/// The words on the rates that differ between the first and the last limit; `None` for a single limit.
fn compared(known: &[(String, [Measured; 2])]) -> Option<String> {
    let [(first, a), .., (last, b)] = known else { return None };
    Some(match [0, 1].map(|which| a[which].differs(&b[which])) {
        [true, true] => format!("; both rates differ between {first} and {last}"),
        [true, false] => format!("; only the rates of fixes differ between {first} and {last}"),
        [false, true] => format!("; only the rates of wrong fixes differ between {first} and {last}"),
        [false, false] => format!("; neither rate of {first} is told apart from that of {last}"),
    })
}
