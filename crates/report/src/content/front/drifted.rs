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
    for (name, trial) in trials {
        let Some([drift, low, high, count]) = navigation::drift_per_metre(trial) else { continue };
        let begin = if message.is_empty() { "" } else { ", " };
        let what = if message.is_empty() { " the pose drifts " } else { " " };
        let path = if message.is_empty() { " mm per metre of path after a fix (" } else { " mm per metre (" };
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
    message
}
