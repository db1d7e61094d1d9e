//! The clause on whether several objects in view help.

use super::measured::Measured;
use crate::{
    content::{conditions::labels::Labels, sections::objects},
    document::{Text, text},
    run::{Run, Trial},
    summary::RunSummary,
};

/// The frames with a fix among those with several objects in view and among those with one, in the trial with the most
/// frames of the rarer kind; the frames of one trial are alike otherwise. Words if no trial has both.
pub(super) fn clause(run: &Run, summary: &RunSummary, labels: &Labels) -> Text {
    let rarer =
        |trial: &Trial| [true, false].map(|several| objects::in_company(trial, several).count()).into_iter().min();
    let trials = run.trials.iter().enumerate().filter(|(_, trial)| rarer(trial) > Some(0));
    let Some((index, trial)) = trials.max_by_key(|(_, trial)| rarer(trial)) else {
        return text!["; no trial has frames with one object in view and others with several"];
    };
    let [several, one] = [true, false].map(|several| {
        let (rate, n) = objects::fixed_in_company(trial, several);
        (Measured::new(rate, " %"), n)
    });
    let verdict = match (several.0.differs(&one.0), several.0.value() > one.0.value()) {
        (false, _) => "that several objects in view help is not shown, since the difference is not significant",
        (true, true) => "several objects in view help",
        (true, false) => "several objects in view do not help",
    };
    let mut message = text![format!("; {verdict}: at {}, ", labels.of_trial(&summary.rows[index]))];
    for (place, ((rate, n), words)) in [(several, "with several in view"), (one, "with one")].into_iter().enumerate() {
        message.push(if place > 0 { " and in " } else { "frames have a fix in " }.into());
        message.extend(rate.text());
        message.extend(text![" of ", n, format!(" {words}")]);
    }
    message
}
