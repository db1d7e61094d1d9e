//! The findings in numbers: counts, then every quantity or series.

use crate::{
    content::{findings::answer, phrases},
    document::{Text, bold, code, text},
    number::Number,
    paired::Comparison,
    run::{Run, Trial},
    summary::{Row, RunSummary},
};

pub(crate) fn section(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Vec<Text> {
    let trials: Vec<&Trial> = run.trials.iter().collect();
    let total = |count: fn(&Row) -> usize| summary.rows.iter().map(count).sum::<usize>();
    let pooled = |group: &str, n: usize| {
        Number::count(n, phrases::over(&trials, "/metrics/evaluation", format!("count {group}")))
    };
    let attempted = total(|row| row.attempted);
    let mut first = text![
        format!("{} trial{} with ", trials.len(), if trials.len() == 1 { "" } else { "s" }),
        pooled("frames", total(|row| row.frames)),
        " frames and ",
        pooled("attempted", attempted),
        " attempts (one for every frame and target in view): "
    ];
    let groups =
        [("found", total(|row| row.found)), ("refused", total(|row| row.rejected)), ("wrong", total(|row| row.wrong))];
    for (index, (group, n)) in groups.into_iter().enumerate() {
        let key = phrases::over(&trials, "/metrics/evaluation", format!("percent {group} of attempted"));
        let fraction = (attempted > 0).then(|| 100.0 * n as f64 / attempted as f64);
        let word = phrases::outcome(group);
        first.extend(text![pooled(group, n), format!(" {word} ("), Number::new(fraction, 1, key), " %"]);
        // Trials that share frames are not independent, so pooled counts carry no interval.
        if let [trial] = trials[..] {
            let [low, high] = phrases::interval(trial, group, n, attempted);
            first.extend(text![", 95 % interval [", low, ", ", high, "]"]);
        }
        first.push(["), ", "), ", ")."][index].into());
    }
    if trials.len() > 1 {
        first.push(
            " These counts pool trials that may share frames; the table of outcomes has the intervals of each trial."
                .into(),
        );
    }
    if total(|row| row.unjudged) > 0 {
        first.extend(text![
            " Ground truth is missing for ",
            pooled("unjudged", total(|row| row.unjudged)),
            " of the fixes; they are not checked."
        ]);
    }
    let mut texts: Vec<Text> = changed(run).into_iter().chain([first]).collect();
    texts.extend(answer::sentences(run, summary, comparisons));
    texts.extend(summary.published.iter().map(|sentence| text![sentence.clone()]));
    texts
}

/// A sentence on the settings that differ from the experiment file; `None` without any.
fn changed(run: &Run) -> Option<Text> {
    let mut settings =
        run.header().command.split(" --set '").skip(1).filter_map(|rest| rest.split_once('\'')).peekable();
    settings.peek()?;
    let mut message = text![bold("This run departs from its experiment file:"), " it was run with "];
    for (index, (setting, _)) in settings.enumerate() {
        if index > 0 {
            message.push(", ".into());
        }
        message.push(code(setting));
    }
    message.push(".".into());
    Some(message)
}
