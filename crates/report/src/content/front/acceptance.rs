//! The answer about the limit of the probability of a wrong answer: fixes and wrong fixes at each value.

use super::measured::{Sample, capitalised};
use crate::{
    content::conditions::labels::value,
    document::{Text, text},
    format::{distinct, short},
    run::Run,
    summary::{Row, RunSummary},
};

/// The trials at a limit: those of frames with the object, and those of frames without it.
pub(super) struct Limit {
    pub(super) name: String,
    pub(super) present: Vec<usize>,
    pub(super) absent: Vec<usize>,
}

/// Whether the frames of a trial lack the object.
pub(crate) fn is_absent(row: &Row) -> bool {
    row.axes.iter().any(|axis| short(&axis.key) == "absent" && axis.value == "true")
}

/// Each value of the axis `key` with its trials, in the order of the run.
fn limits(summary: &RunSummary, key: &str) -> Vec<Limit> {
    let of = |name: String| {
        let members = (0..summary.rows.len()).filter(|&index| value(&summary.rows[index], key) == name);
        let (absent, present) = members.partition(|&index| is_absent(&summary.rows[index]));
        Limit { name, present, absent }
    };
    distinct(summary.rows.iter().map(|row| value(row, key))).into_iter().map(of).collect()
}

/// The limits of each method, the first method of the run first.
pub(super) fn methods(summary: &RunSummary, key: &str) -> Vec<(String, Vec<Limit>)> {
    let several = summary.rows.iter().any(|row| row.search != summary.rows[0].search);
    let name = |row: &Row| if several { row.search.clone() } else { row.method() };
    let own = |method: String| {
        let of =
            |members: &[usize]| members.iter().copied().filter(|&index| name(&summary.rows[index]) == method).collect();
        let limits = limits(summary, key).into_iter();
        let limits =
            limits.map(|limit| Limit { present: of(&limit.present), absent: of(&limit.absent), ..limit }).collect();
        (method.clone(), limits)
    };
    distinct(summary.rows.iter().map(name)).into_iter().map(own).collect()
}

/// The rates of fixes and of wrong fixes among frames with the object, and that of answers among those without it, with the
/// first method.
pub(super) fn sentence(run: &Run, summary: &RunSummary, key: &str) -> Option<Text> {
    let methods = methods(summary, key);
    let several = methods.len() > 1;
    let (method, limits) = methods.into_iter().next()?;
    let mut message = if several { text![format!("with {method}, ")] } else { Text::new() };
    for (place, limit) in limits.into_iter().enumerate() {
        let [present, absent] = [&limit.present, &limit.absent].map(|members| Sample::of(run, summary, members));
        if present.attempted == 0 {
            continue;
        }
        let begin = if place == 0 { "" } else { "; " };
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
    if several {
        message.push("; the table has the other methods".into());
    }
    (!message.is_empty()).then(|| capitalised(message))
}
