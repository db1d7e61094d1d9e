//! The answer about the limit of the probability of a wrong answer: fixes and wrong fixes at each value.

use super::measured::{Sample, capitalised};
use crate::{
    content::{conditions::labels::value, phrases},
    document::{Text, text},
    format::distinct,
    run::Run,
    summary::RunSummary,
};

/// Each value of the axis `key`, in the order of the run, over all trials that have it.
pub(super) fn sentence(run: &Run, summary: &RunSummary, key: &str) -> Option<Text> {
    let mut message = Text::new();
    for limit in distinct(summary.rows.iter().map(|row| value(row, key))) {
        let members: Vec<usize> =
            (0..summary.rows.len()).filter(|&index| value(&summary.rows[index], key) == limit).collect();
        let sample = Sample::of(run, summary, &members);
        if sample.attempted == 0 {
            continue;
        }
        message.push(format!("{}at the limit {limit}, ", if message.is_empty() { "" } else { "; " }).into());
        message.extend(sample.rate());
        message.extend(text![" of ", sample.n(), " attempts have a fix, and "]);
        message.extend(text![phrases::pooled_count(&sample.trials, "wrong", sample.wrong), " of the fixes "]);
        message.push(if sample.wrong == 1 { "is wrong" } else { "are wrong" }.into());
    }
    (!message.is_empty()).then(|| capitalised(message))
}
