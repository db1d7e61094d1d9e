//! The conclusion of the first page and its limits.

use crate::{
    content::sections::{navigation, significance},
    document::{Text, bold, text},
    format::counted,
    paired::Comparison,
    proportion,
    run::Run,
    summary::RunSummary,
};

/// The clearest difference between trials, the published figures of the experiment, and the limits of the result.
pub(super) fn sentences(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Vec<Text> {
    let mut conclusion = text![bold("Conclusion. ")];
    match significance::sentences(run, comparisons, 1).into_iter().next() {
        Some(sentence) => conclusion.extend(sentence),
        None => conclusion.push("No two trials share their frames, so no difference is tested.".into()),
    }
    conclusion.extend(summary.published.iter().map(|sentence| format!(" {sentence}").into()));
    vec![conclusion, text![bold("Limits. "), limits(run, summary)]]
}

/// The conditions beyond which the result says nothing, in two sentences.
fn limits(run: &Run, summary: &RunSummary) -> String {
    let headers = || run.trials.iter().map(|trial| &trial.header);
    let recorded = headers().any(|header| header.configuration.contains("name = \"dataset\""));
    let truth = run.trials.iter().any(|trial| trial.frames.iter().any(|frame| frame.truth.is_some()));
    let seeds: std::collections::BTreeSet<_> = headers().map(|header| format!("{:?}", header.seeds)).collect();
    let data = match (recorded, truth) {
        (true, true) => "These are recordings with ground truth".to_owned(),
        (true, false) => "These are recordings without ground truth, so that wrong fixes are not counted".to_owned(),
        (false, _) => format!("The data are simulated, with {}", counted(seeds.len(), "seed", "seeds")),
    };
    let targets = run.header().targets.len();
    let site = match targets {
        0 => ", and every frame has another object".to_owned(),
        targets => format!(", of one site with {}", counted(targets, "target", "targets")),
    };
    let dives = if run.trials.iter().any(navigation::navigates) {
        "Each trial is one dive: the intervals of its errors are over blocks of its frames, not over other dives. "
    } else {
        ""
    };
    let min = summary.rows.iter().map(|row| row.attempted).min().unwrap_or(0);
    let successive = headers().any(proportion::is_trajectory);
    let bound = 100.0 * proportion::interval_of_counts(successive, 0, min).1;
    // Two significant digits: a thousand attempts and more bound the rate below a tenth of a percent.
    let digits = if bound > 0.0 { (1.0 - bound.log10().floor()).clamp(1.0, 4.0) as usize } else { 1 };
    format!(
        "{data}{site}. {dives}The smallest trial has {}{}: without a wrong fix among them, the rate of wrong fixes may still be \
         {bound:.digits$} % (upper end of the 95 % interval). The section on threats to validity lists all limits.",
        counted(min, "attempt", "attempts"),
        if successive { ", which successive frames make dependent" } else { "" }
    )
}
