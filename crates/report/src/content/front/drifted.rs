//! The clause on the drift between fixes.

use crate::{
    content::sections::navigation,
    document::{Text, text},
    run::Trial,
};

/// The drift of each named trial, with its extremes over single fix intervals; empty without fix intervals.
///
/// A dive has few of these, so that their range stands in place of a confidence interval.
pub(super) fn clause(trials: &[(String, &Trial)]) -> Text {
    let mut message = Text::new();
    let mut ranges: Vec<[f64; 2]> = Vec::new();
    for (name, trial) in trials {
        let Some([drift, low, high, count]) = navigation::drift_per_metre(trial) else { continue };
        ranges.extend(low.value.zip(high.value).map(<[f64; 2]>::from));
        let begin = if message.is_empty() { "" } else { ", " };
        let what = if message.is_empty() { " the pose drifts " } else { " " };
        let path = if message.is_empty() { " mm per metre of path between two fixes (" } else { " mm per metre (" };
        message.extend(text![
            format!("{begin}with {name}{what}"),
            drift,
            path,
            low,
            " to ",
            high,
            " in its ",
            count,
            " intervals)"
        ]);
    }
    let disjoint = |a: &[f64; 2], b: &[f64; 2]| a[1] < b[0] || b[1] < a[0];
    if ranges.len() > 1 && !ranges.iter().any(|a| ranges.iter().any(|b| disjoint(a, b))) {
        message.push(", ranges that overlap".into());
    }
    message
}
