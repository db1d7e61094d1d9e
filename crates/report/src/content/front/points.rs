//! The answer about the points of interest of an inspection.

use super::measured::{Measured, capitalised};
use crate::{
    content::{conditions::labels::Labels, sections::inspection},
    document::{Text, text},
    run::Run,
    summary::RunSummary,
};

/// The points with the smallest and the largest median error in every trial.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let mut message = Text::new();
    let mut largest: Vec<Measured> = Vec::new();
    for (trial, row) in run.trials.iter().zip(&summary.rows) {
        let Some(points) = inspection::extremes(trial) else { continue };
        let begin = if message.is_empty() { "" } else { "; " };
        message
            .push(format!("{begin}with {}, points of interest have median errors from ", labels.of_trial(row)).into());
        for (place, point) in points.iter().enumerate() {
            let error = Measured::new(inspection::median(trial, point), " mm");
            message.extend(text![if place > 0 { " to " } else { "" }]);
            message.extend(error.text());
            message.push(format!(" ({point})").into());
            if place > 0 {
                largest.push(error);
            }
        }
    }
    if let [first, second] = &largest[..] {
        let differ = first.differs(second);
        message.push(
            if differ {
                ", where the largest errors differ significantly"
            } else {
                ", where the largest errors do not differ significantly"
            }
            .into(),
        );
    }
    message.retain(|span| !span.plain().is_empty());
    (!message.is_empty()).then(|| capitalised(message))
}
