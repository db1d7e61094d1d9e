//! What the numbers do not show; each point stands only where the logs give cause for it.

use crate::{
    RunSummary,
    document::{Block, Section, Text, text},
    paired::Comparison,
    proportion,
    run::Run,
};

pub(super) fn section(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Section {
    let mut items: Vec<Text> = Vec::new();
    let headers = || run.trials.iter().map(|trial| &trial.header);
    let truth = run.trials.iter().any(|trial| trial.frames.iter().any(|frame| frame.truth.is_some()));
    let recorded = headers().any(|header| header.configuration.contains("name = \"dataset\""));
    if !recorded {
        items.push(text!["Construct: the data are simulated. Methods and simulator share a camera model without its unknown errors unless the configuration adds some, so that real images may be harder than these."]);
    }
    if !truth {
        items.push(text!["Construct: there is no truth. Fixes are judged by their own residuals, which do not see an error that all points share; nothing here says how many are wrong."]);
    }
    if run.trials.iter().any(|trial| trial.disparity.1 > 0) {
        items.push(text!["Construct: the measured noise of the disparity leaves out pairs further than 2 px from truth, so it is a lower bound."]);
    }
    let low = summary.rows.iter().filter(|row| row.nees_count >= 20).filter_map(|row| row.nees_mean);
    if low.fold(f64::INFINITY, f64::min) < 4.0 {
        items.push(text!["Construct: where the mean NEES is well below 6, covariances and protection levels are wider than the errors ask for. They allow for a calibration that errs and for the corner noise that the method is told (Section “Data”), whether the data have as much of either or not."]);
    }
    if headers().any(|header| header.prior_position_sigma.is_some()) {
        items.push(text!["Internal: rough poses are drawn with the spread that the method is told. A vehicle whose navigation is worse than it says would be refused more often, or search where nothing is."]);
    }
    let min = summary.rows.iter().map(|row| row.attempted).min().unwrap_or(0);
    if min < 300 {
        let trajectory = headers().any(proportion::is_trajectory);
        let bound = 100.0 * proportion::interval_of_counts(trajectory, 0, min).1;
        items.push(text![format!(
            "Statistical: the smallest trial has {min} attempt{}. Where it shows no wrong fix, the rate may still be {bound:.1} % (the upper end of its 95 % interval).",
            if min == 1 { "" } else { "s" }
        )]);
    }
    if let Some(trial) = run.trials.iter().find(|trial| trial.every() > 1) {
        items.push(text![format!(
            "Statistical: counts and root mean squares are over all {} frames of a trial, medians and quantiles over one frame in {}, which was logged.",
            trial.count(),
            trial.every()
        )]);
    }
    if !comparisons.is_empty() {
        items.push(text!["Statistical: frames of one passage are not independent. The bootstrap draws blocks; the signed rank test does not, and its p is too small where the differences of neighbouring frames agree. A difference is called significant only where both say so."]);
    }
    let sites: Vec<&String> = headers().map(|header| &header.site).collect();
    // Problems have none: every frame brings another object.
    if !run.header().targets.is_empty() && sites.iter().all(|site| *site == sites[0]) {
        items.push(text![format!(
            "External: one site of {} target{}; nothing is said of objects of other shape, size or symmetry.",
            run.header().targets.len(),
            if run.header().targets.len() == 1 { "" } else { "s" }
        )]);
    }
    for lacking in &summary.lacking {
        items.push(text![format!("Internal: {lacking}. What is lost is in no number here.")]);
    }
    let seeds: std::collections::BTreeSet<_> = headers().map(|header| format!("{:?}", header.seeds)).collect();
    if seeds.len() == 1 && !recorded {
        items.push(text!["External: one seed. Another one draws other views and noise; the intervals say how far the results may move."]);
    }
    if summary.rows.iter().any(|row| row.times.total_ms.is_some()) {
        items.push(text!["Times are wall clock of one machine that may have done other work."]);
        items.extend(summary.shared_times().map(|shared| text![shared]));
    }
    Section::new("Threats to validity").with([Block::Items(items)])
}
