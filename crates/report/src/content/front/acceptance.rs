//! The answer about the limit of the probability of a wrong answer: fixes and wrong fixes at each value.

use super::measured::{Sample, capitalised};
use crate::{
    content::conditions::labels::value,
    document::{Text, text},
    format::{distinct, short},
    run::Run,
    summary::RunSummary,
};

/// The trials at a limit: those of frames with the object, and those of frames without it.
pub(super) struct Limit {
    pub(super) name: String,
    pub(super) present: Vec<usize>,
    pub(super) absent: Vec<usize>,
}

/// Each value of the axis `key` with its trials, in the order of the run.
pub(super) fn limits(summary: &RunSummary, key: &str) -> Vec<Limit> {
    let is_absent = |index: &usize| {
        summary.rows[*index].axes.iter().any(|axis| short(&axis.key) == "absent" && axis.value == "true")
    };
    let of = |name: String| {
        let members = (0..summary.rows.len()).filter(|&index| value(&summary.rows[index], key) == name);
        let (absent, present) = members.partition(is_absent);
        Limit { name, present, absent }
    };
    distinct(summary.rows.iter().map(|row| value(row, key))).into_iter().map(of).collect()
}

/// The rates of fixes and of wrong fixes among frames with the object, and that of answers among those without it.
pub(super) fn sentence(run: &Run, summary: &RunSummary, key: &str) -> Option<Text> {
    let mut message = Text::new();
    for limit in limits(summary, key) {
        let [present, absent] = [&limit.present, &limit.absent].map(|members| Sample::of(run, summary, members));
        if present.attempted == 0 {
            continue;
        }
        let begin = if message.is_empty() { "" } else { "; " };
        message.push(format!("{begin}at the limit {}, ", limit.name).into());
        message.extend(present.rate());
        message.extend(text![" of ", present.n(), " objects in view have a fix and "]);
        message.extend(present.wrong_rate().text());
        message.push(" a wrong one".into());
        if absent.attempted > 0 {
            message.push(", and ".into());
            message.extend(absent.wrong_rate().text());
            message.extend(text![" of ", absent.n(), " frames without the object are answered"]);
        }
    }
    (!message.is_empty()).then(|| capitalised(message))
}
