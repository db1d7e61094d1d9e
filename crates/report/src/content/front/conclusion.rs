//! The conclusion of the first page and its limits.

use super::{
    acceptance,
    contrast::{Contrast, simultaneous},
    cost,
    kind::{Asked, Kind},
    measured::Sample,
    navigated,
};
use crate::{
    content::{
        conditions::labels::Labels,
        phrases::Unit,
        sections::{navigation, significance},
    },
    document::{Text, bold, text},
    format::{counted, quoted},
    paired::Comparison,
    proportion,
    run::Run,
    summary::RunSummary,
};

/// The clearest difference of what the question asks for if it `concludes`, the published figures of the experiment, and
/// the limits of the result.
pub(super) fn sentences(run: &Run, summary: &RunSummary, comparisons: &[Comparison], concludes: bool) -> Vec<Text> {
    let mut shown = if concludes { differences(run, summary, comparisons) } else { Vec::new() };
    let mut paragraphs = Vec::new();
    let concludes = !shown.is_empty();
    shown.extend(summary.published.iter().map(|sentence| text![sentence.clone()]));
    if !shown.is_empty() {
        let mut conclusion = text![if concludes { bold("Conclusion.") } else { "".into() }];
        shown.into_iter().for_each(|sentence| {
            conclusion.push(" ".into());
            conclusion.extend(sentence);
        });
        paragraphs.push(conclusion);
    }
    paragraphs.push(text![bold("Limits. "), limits(run, summary)]);
    paragraphs
}

/// The clearest difference of what the question asks for.
fn differences(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Vec<Text> {
    let (kind, asked) = (Kind::of(run, summary), Asked::of(&summary.question));
    let mut shown: Vec<Text> = Vec::new();
    if asked.rate {
        shown.extend(rates(run, summary, &kind));
    }
    shown.extend(match kind {
        Kind::Navigation => navigated::conclusion(run, summary),
        Kind::Cost => cost::conclusion(run, summary),
        _ => None,
    });
    let accuracy = matches!(kind, Kind::Outliers(_) | Kind::Along(_) | Kind::Cases) && asked.accuracy;
    if accuracy {
        shown.extend(significance::sentences(run, comparisons, 1));
    }
    shown
}

/// The difference between the highest and the lowest rate of fixes, over common attempts; `None` without any.
///
/// Along an axis these are the ends of a single series.
fn rates(run: &Run, summary: &RunSummary, kind: &Kind) -> Option<Text> {
    let labels = Labels::of(summary);
    let series = || -> Vec<(String, Vec<usize>)> {
        let named = |(name, members): (String, _)| (format!("with {}", quoted(&name)), members);
        labels.series(summary).into_iter().map(named).collect()
    };
    let mut cases = match kind {
        Kind::Acceptance(key) => {
            let (method, limits) = acceptance::methods(summary, key).into_iter().next()?;
            let named = |limit: &str| format!("with {method} at the limit {limit}");
            limits.into_iter().map(|limit| (named(&limit.name), limit.present)).collect()
        }
        Kind::Along(key) if labels.series(summary).len() == 1 => {
            let place = |index: usize| format!("at {}", labels.place(&summary.rows[index], key));
            (0..summary.rows.len()).map(|index| (place(index), vec![index])).collect()
        }
        Kind::Along(_) | Kind::Cases => series(),
        _ => return None,
    };
    let fraction = |case: &(String, Vec<usize>)| Sample::of(run, summary, &case.1).fraction();
    cases.sort_by(|a, b| fraction(b).total_cmp(&fraction(a)));
    let [highest, .., lowest] = &cases[..] else { return None };
    let contrast = Contrast { run, summary };
    let found = contrast.of_rates(&highest.1, &lowest.1, 0.95)?;
    let [pairs, value, low, high] = contrast.numbers([&highest.1, &lowest.1], "found", (found, Unit::Plain, 1));
    if found.value == 0.0 {
        return Some(text![
            "Over ",
            pairs,
            format!(" common attempts, the rates of fixes {} and {} are equal.", highest.0, lowest.0)
        ]);
    }
    // These two are chosen as the extremes of all, so the verdict allows for all comparisons with the best.
    let strict = contrast.of_rates(&highest.1, &lowest.1, simultaneous(cases.len())).is_some_and(|of| of.significant());
    let significant = match (strict, found.significant()) {
        (true, _) => "a significant difference",
        (false, true) => "which is not significant after adjustment for all comparisons with the best",
        (false, false) => "which is not significant",
    };
    Some(text![
        "Over ",
        pairs,
        " common attempts, the rate of fixes is ",
        value,
        " points [",
        low,
        ", ",
        high,
        format!("] higher {} than {}, {significant}.", highest.0, lowest.0)
    ])
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
        targets => {
            let sites: std::collections::BTreeSet<&str> = headers().map(|header| header.site.as_str()).collect();
            let targets = counted(targets, "target", "targets");
            match sites.len() {
                1 => format!(", of one site with {targets}"),
                sites => format!(", of {sites} sites or variants of a site with {targets}"),
            }
        }
    };
    let dives = if run.trials.iter().any(navigation::navigates) {
        "Each trial is one dive: the intervals of its errors are over blocks of its frames, not over other dives. "
    } else {
        ""
    };
    let min = summary.rows.iter().map(|row| row.attempted).min().unwrap_or(0);
    let counts = |absent: bool| {
        let own = summary.rows.iter().filter(move |row| acceptance::is_absent(row) == absent);
        own.fold((0, 0), |(w, a), row| (w + row.wrong, a + row.attempted))
    };
    let ((wrong, all), (answered, without)) = (counts(false), counts(true));
    let successive = headers().any(proportion::is_trajectory);
    let bound = 100.0 * proportion::interval_of_counts(successive, 0, min).1;
    // Two significant digits: a thousand attempts and more bound the rate below a tenth of a percent.
    let digits = if bound > 0.0 { (1.0 - bound.log10().floor()).clamp(1.0, 4.0) as usize } else { 1 };
    let worst = summary.rows.iter().map(|row| (row.wrong, row.attempted)).max().unwrap_or_default();
    let wrong = match wrong {
        _ if without > 0 => format!(
            "{wrong} of {all} objects in view have a wrong fix, and {answered} of {without} frames without the object are answered. "
        ),
        0 if min > 0 && !summary.rows.iter().all(|row| row.unjudged == row.found) => format!(
            "No fix is wrong. The smallest trial has {}{}, after which the rate of wrong fixes may still be up to {bound:.digits$} % \
             (95 % interval). ",
            counted(min, "attempt", "attempts"),
            if successive && min > 1 { ", which depend on each other" } else { "" }
        ),
        0 => String::new(),
        _ => format!("{wrong} of {all} attempts are wrong fixes, at most {} of {} in one trial. ", worst.0, worst.1),
    };
    format!("{data}{site}. {dives}{wrong}The section on threats to validity explains further limits.")
}
