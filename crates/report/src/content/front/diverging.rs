//! The answer about two trials of one dive that agree up to a frame: their errors from that frame on.

use super::measured::{Measured, capitalised, navigated_rms};
use crate::{
    content::{
        conditions::labels::Labels,
        phrases::{self, Unit},
        sections::navigation,
    },
    document::{Text, text},
    navigation_quantity::NavigationQuantity::Position,
    paired,
    run::{Run, Trial},
    summary::RunSummary,
};

/// The errors of both trials at the last frame and over the frames from the first difference on.
///
/// The last frame alone has no interval. The result is `None` unless there are two trials of one dive that begin alike.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let [first, second] = &run.trials[..] else { return None };
    if paired::data(first, run.joined) != paired::data(second, run.joined) {
        return None;
    }
    let (frame, stamp) = parting(first, second)?;
    let name = |index: usize| labels.of_trial(&summary.rows[index]);
    let last = |trial| navigation::statistic(trial, "last", Position, Unit::Millimetres);
    let rms = |trial: &Trial| navigated_rms(trial, Position, [stamp, trial.span()[1]]);
    let (without, with) = (rms(first), rms(second));
    let message = text![
        "at the last frame of the dive the camera position error is ",
        last(first),
        format!(" mm with {} and ", name(0)),
        last(second),
        format!(" mm with {} (a single frame has no interval); from frame ", name(1)),
        phrases::frame(first, frame, stamp),
        " on, where the trials first differ, it is "
    ];
    let mut message = message;
    message.extend(without.text());
    message.push(" and ".into());
    message.extend(with.text());
    message.push(verdict(&without, &with).into());
    Some(capitalised(message))
}

/// The number and the stamp of the first frame at which the errors differ; `None` if they differ from the beginning, or
/// nowhere.
fn parting(first: &Trial, second: &Trial) -> Option<(u64, u64)> {
    let errors = |trial: &Trial| -> Vec<(u64, u64, Option<f64>)> {
        let frames = trial.sample().filter_map(|frame| Some((frame, frame.navigated.as_ref()?)));
        frames.map(|(frame, navigated)| (frame.number, frame.stamp_ns, navigated.get(Position))).collect()
    };
    let (first, second) = (errors(first), errors(second));
    let place = first.iter().zip(&second).position(|(a, b)| a != b)?;
    let alike = first[..place].iter().any(|(.., error)| error.is_some());
    alike.then(|| (first[place].0, first[place].1))
}

/// The words on whether the errors differ.
fn verdict(without: &Measured, with: &Measured) -> &'static str {
    match without.differs(with) {
        false => ", without a significant difference",
        true => ", a significant difference",
    }
}
