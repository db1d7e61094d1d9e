//! The answer about the pose of a vehicle between fixes.

use super::{
    diverging, drifted,
    kind::Asked,
    measured::{Measured, capitalised, navigated_rms},
    ranking::{self, Case, Words},
};
use crate::{
    content::conditions::{axes, labels::Labels},
    document::{Text, text},
    navigation_quantity::NavigationQuantity,
    run::{Run, Trial},
    summary::RunSummary,
};

/// Maximum number of trials that the sentence lists; of more it has the ends of the axis and the extremes of the error.
const LISTED: usize = 3;

/// A trial with its root mean square position error, navigated and by odometry alone from the first fix.
struct Dive {
    index: usize,
    navigated: Measured,
    alone: Measured,
}

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, asked: Asked) -> Option<Text> {
    if asked.removal
        && let Some(message) = diverging::sentence(run, summary, labels)
    {
        return Some(message);
    }
    let mut known: Vec<Dive> = run
        .trials
        .iter()
        .enumerate()
        .filter_map(|(index, trial)| {
            let rms = |quantity| navigated_rms(trial, quantity, trial.span());
            let navigated = rms(NavigationQuantity::Position);
            navigated.value().is_finite().then(|| Dive {
                index,
                navigated,
                alone: rms(NavigationQuantity::AlonePosition),
            })
        })
        .collect();
    let place = |dive: &Dive| labels.along.as_ref().and_then(|key| axes::on(&summary.rows[dive.index], key));
    known.sort_by(|a, b| place(a).unwrap_or(0.0).total_cmp(&place(b).unwrap_or(0.0)));
    let known = listed(known, labels.along.is_some());
    let name = |dive: &Dive| labels.of_trial(&summary.rows[dive.index]);
    let mut message = Text::new();
    if asked.drift {
        message.extend(drifted::clause(
            &known.iter().map(|dive| (name(dive), &run.trials[dive.index])).collect::<Vec<_>>(),
        ));
    }
    if asked.bounded {
        message.extend(verdict(&known));
    }
    for (place, dive) in known.iter().enumerate() {
        let begin = if message.is_empty() || place == 0 && asked.bounded { "" } else { "; " };
        let what = if place == 0 { "the camera position error is " } else { "it is " };
        message.push(format!("{begin}with {} {what}", name(dive)).into());
        message.extend(dive.navigated.text());
        if dive.alone.value().is_finite() {
            message.push(", without fixes after the first ".into());
            message.extend(dive.alone.text());
        }
    }
    if let [first, .., last] = &known[..]
        && !asked.bounded
    {
        message.push(compared(first, last, &known, labels.along.is_some()).into());
    }
    (!message.is_empty()).then(|| capitalised(message))
}

/// The ranking of the trials by their navigated error; `None` for a single trial.
pub(super) fn conclusion(run: &Run, summary: &RunSummary) -> Option<Text> {
    let labels = Labels::of(summary);
    let case = |(index, trial): (usize, &Trial)| Case {
        name: labels.of_trial(&summary.rows[index]),
        value: navigated_rms(trial, NavigationQuantity::Position, trial.span()),
        members: vec![index],
        tail: Text::new(),
    };
    let mut cases = ranking::decreasing(run.trials.iter().enumerate().map(case).collect());
    cases.retain(|case| case.value.value().is_finite());
    cases.reverse();
    let words =
        Words { quantity: "navigated camera position error", best: "smallest", worst: "largest", worse: "larger" };
    let mut message = ranking::clause(&cases, &words, &|a, b| a.value.differs(&b.value));
    message.push(".".into());
    (cases.len() > 1).then(|| capitalised(message))
}

/// The trials that the sentence lists, in their order.
///
/// Along an axis these are its ends and the trial with the largest error, otherwise the extremes of the error.
fn listed(known: Vec<Dive>, along: bool) -> Vec<Dive> {
    if known.len() <= LISTED {
        return known;
    }
    let by = |a: &&Dive, b: &&Dive| a.navigated.value().total_cmp(&b.navigated.value());
    let indices = |of: [Option<&Dive>; 3]| of.map(|dive| dive.map(|dive| dive.index));
    let kept = match along {
        true => indices([known.first(), known.last(), known.iter().max_by(by)]),
        false => indices([known.iter().min_by(by), known.iter().max_by(by), None]),
    };
    known.into_iter().filter(|dive| kept.contains(&Some(dive.index))).collect()
}

/// The answer whether fixes keep the error smaller than odometry alone does, in every trial.
fn verdict(known: &[Dive]) -> Text {
    let smaller = |dive: &Dive| dive.navigated.differs(&dive.alone) && dive.navigated.value() < dive.alone.value();
    let larger = |dive: &Dive| dive.navigated.differs(&dive.alone) && dive.navigated.value() > dive.alone.value();
    if known.iter().all(smaller) {
        text!["yes: "]
    } else if known.iter().any(larger) {
        text!["no, odometry alone has a smaller error in some trials: "]
    } else {
        text!["not shown, since some differences from odometry alone are not significant: "]
    }
}

/// The words on whether the listed errors differ.
fn compared(first: &Dive, last: &Dive, known: &[Dive], along: bool) -> &'static str {
    let any = known.iter().any(|a| known.iter().any(|b| a.navigated.differs(&b.navigated)));
    match (first.navigated.differs(&last.navigated), any, known.len()) {
        (false, false, _) => "; the errors with all fixes do not differ significantly",
        (true, _, 3..) if along && !known[1].navigated.differs(&last.navigated) => {
            ", where the last two do not differ significantly"
        }
        _ => "",
    }
}
