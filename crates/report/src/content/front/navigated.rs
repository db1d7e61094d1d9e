//! The answer about the pose of a vehicle between fixes.

use super::{kind::Asked, measured::capitalised};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        phrases::Unit,
        sections::navigation,
    },
    document::{Text, text},
    navigation_quantity::NavigationQuantity,
    run::Run,
    summary::RunSummary,
};

/// Maximum number of trials that the sentence lists; of more it has the ends of the axis, or the smallest and the
/// largest error.
const LISTED: usize = 3;

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, asked: Asked) -> Option<Text> {
    let rms = |index: usize| {
        let error = navigation::statistic(&run.trials[index], "rms", NavigationQuantity::Position, Unit::Millimetres);
        error.value
    };
    let mut known: Vec<usize> = (0..run.trials.len()).filter(|&index| rms(index).is_some()).collect();
    if let Some(key) = &labels.along {
        let place = |index: usize| axes::on(&summary.rows[index], key).unwrap_or(f64::INFINITY);
        known.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
    }
    if known.len() > LISTED {
        if labels.along.is_none() {
            known.sort_by(|&a, &b| rms(a).unwrap_or(f64::INFINITY).total_cmp(&rms(b).unwrap_or(f64::INFINITY)));
        }
        known = vec![known[0], known[known.len() - 1]];
    }
    let mut message = Text::new();
    for (place, &index) in known.iter().enumerate() {
        let trial = &run.trials[index];
        let number = |name| navigation::statistic(trial, name, NavigationQuantity::Position, Unit::Millimetres);
        let what = if place == 0 { "the camera position error is" } else { "it is" };
        message.extend(text![
            format!("{}with {} {what} ", if place == 0 { "" } else { "; " }, labels.of_trial(&summary.rows[index])),
            number("rms"),
            " mm RMS, below ",
            number("q95"),
            " mm in 95 % of the frames and ",
            number("last"),
            " mm at the last"
        ]);
        if asked.drift
            && let Some(drift) = navigation::drift_per_metre(trial)
        {
            message.extend(text![", with a drift of ", drift, " mm per metre between fixes"]);
        }
    }
    (!message.is_empty()).then(|| capitalised(message))
}
