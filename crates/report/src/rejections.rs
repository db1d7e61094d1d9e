//! The most common reason for which the attempts of a run have no fix, as a sentence with its count and its remedy.

use std::collections::BTreeMap;

use crate::{
    field::Field,
    run::{AttemptRow, Run, Trial},
};

/// The sentence; `None` for a run in which every attempt has a fix.
///
/// A run without any attempt names the most common reason of its frames. The reason comes with the logged sentence of a
/// typical attempt, which ends with the remedy for its own numbers.
///
/// The numbers are those of attempts, of attempts without a fix, and of frames; the reasons are those of attempts and of
/// frames without an attempt, counted for each trial.
pub(crate) fn sentence(
    run: &Run,
    [attempted, rejected, frames]: [usize; 3],
    [reasons, idle]: [Vec<&BTreeMap<String, usize>>; 2],
) -> Option<String> {
    let fixes = attempted - rejected;
    let counted = counts(if attempted > 0 { &reasons } else { &idle });
    let (reason, count) = counted.into_iter().rev().max_by_key(|(_, count)| *count)?;
    let why = typical(run, reason, attempted > 0).map_or_else(String::new, |why| format!(": {why}"));
    Some(match (attempted, fixes) {
        (0, _) => format!("no fix in {frames} frames: {count} frames without an attempt are `{reason}`{why}"),
        (_, 0) => format!("no fix in {frames} frames: {count} of {attempted} attempts are `{reason}`{why}"),
        _ => format!("Most common rejection: `{reason}`, {count} of {rejected} rejected attempts, typically{why}"),
    })
}

fn counts<'a>(of_trials: &[&'a BTreeMap<String, usize>]) -> BTreeMap<&'a str, usize> {
    let mut counts = BTreeMap::new();
    for (reason, count) in of_trials.iter().copied().flatten() {
        *counts.entry(reason.as_str()).or_default() += count;
    }
    counts
}

/// The sentence of a typical attempt: the one with the median probability of a wrong answer.
///
/// Without probabilities it is the middle one in the order of the logs. The result is `None` if no log has a sentence.
fn typical<'a>(run: &'a Run, reason: &str, attempts: bool) -> Option<&'a str> {
    let of_trial = |trial: &'a Trial| {
        let all = trial.frames.iter().flat_map(move |frame| trial.rows_of(frame));
        all.filter(move |row| row.is_attempt() == attempts).map(move |row| (trial, row))
    };
    let mut all: Vec<(&Trial, &AttemptRow)> = run.trials.iter().flat_map(of_trial).collect();
    all.retain(|(trial, row)| !row.found() && !row.wrong() && trial.reason(row) == reason);
    all.retain(|(trial, row)| !trial.explanation(row).is_empty());
    let p_wrong = |row: &AttemptRow| row.get(Field::PWrong).unwrap_or(f64::INFINITY);
    all.sort_by(|(_, a), (_, b)| p_wrong(a).total_cmp(&p_wrong(b)));
    let (trial, row) = all.get(all.len().saturating_sub(1) / 2)?;
    Some(trial.explanation(row))
}
