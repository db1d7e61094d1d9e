//! The section on threats to validity; each item appears only if the logs give cause for it.

use crate::{
    document::{Block, Section, Text, text},
    paired::Comparison,
    proportion,
    run::Run,
    summary::RunSummary,
};

pub(crate) fn section(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Section {
    let mut items: Vec<Text> = Vec::new();
    let headers = || run.trials.iter().map(|trial| &trial.header);
    let truth = run.trials.iter().any(|trial| trial.frames.iter().any(|frame| frame.truth.is_some()));
    let recorded = headers().any(|header| header.configuration.contains("name = \"dataset\""));
    if !recorded {
        items.push(text!["Construct: the data are simulated. Methods and simulator share one camera model, with calibration errors only if the configuration adds them; real images may be harder."]);
    }
    if !truth {
        items.push(text!["Construct: there is no ground truth. Fixes are checked by their residuals only, which cannot show an error common to all points; the number of wrong fixes is unknown."]);
    }
    if run.trials.iter().any(|trial| trial.disparity.1 > 0) {
        items.push(text!["Construct: the measured disparity noise excludes pairs more than 2 px from the true projection, so it is a lower bound."]);
    }
    let low = summary.rows.iter().filter(|row| row.nees_count >= 20).filter_map(|row| row.nees_mean);
    if low.fold(f64::INFINITY, f64::min) < 4.0 {
        items.push(text!["Construct: a mean NEES well below 6 means that covariances and protection levels are larger than the errors require. They include the assumed calibration error and the assumed corner noise (Section “Data”), even if the data have less of either."]);
    }
    if headers().any(|header| header.prior_position_sigma.is_some()) {
        items.push(text!["Internal: prior poses are generated with the uncertainty that the method is given. A vehicle with an optimistic navigation covariance would be rejected more often, or would search in the wrong place."]);
    }
    let min = summary.rows.iter().map(|row| row.attempted).min().unwrap_or(0);
    if min < 300 {
        let trajectory = headers().any(proportion::is_trajectory);
        let bound = 100.0 * proportion::interval_of_counts(trajectory, 0, min).1;
        items.push(text![format!(
            "Statistical: the smallest trial has {min} attempt{}. Even without a wrong fix its rate of wrong fixes may be up to {bound:.1} % (upper end of the 95 % interval).",
            if min == 1 { "" } else { "s" }
        )]);
    }
    if let Some(trial) = run.trials.iter().find(|trial| trial.every() > 1) {
        items.push(text![format!(
            "Statistical: counts and RMS values are over all {} frames of a trial, medians and quantiles over the logged frames, one in {}.",
            trial.count(),
            trial.every()
        )]);
    }
    if !comparisons.is_empty() {
        items.push(text!["Statistical: frames of one sequence are not independent. The bootstrap resamples blocks; the signed rank test does not, so its p is too small if neighbouring differences are correlated. A difference counts as significant only if both agree."]);
    }
    let sites: Vec<&String> = headers().map(|header| &header.site).collect();
    // Generated problems have no site: every frame has another object.
    if !run.header().targets.is_empty() && sites.iter().all(|site| *site == sites[0]) {
        items.push(text![format!(
            "External: one site with {} target{}; the results do not cover objects of other shape, size or symmetry.",
            run.header().targets.len(),
            if run.header().targets.len() == 1 { "" } else { "s" }
        )]);
    }
    for lacking in &summary.lacking {
        items.push(text![format!("Internal: {lacking}. No number here includes the lost part.")]);
    }
    let seeds: std::collections::BTreeSet<_> = headers().map(|header| format!("{:?}", header.seeds)).collect();
    if seeds.len() == 1 && !recorded {
        items.push(text!["External: one seed. Another seed gives other views and other noise; the intervals show how far the results may change."]);
    }
    if summary.rows.iter().any(|row| row.times.total_ms.is_some()) {
        items.push(text!["Times are wall-clock times of one machine, which may have had other load."]);
        items.extend(summary.shared_times().map(|shared| text![shared]));
    }
    Section::new("Threats to validity").with([Block::Items(items)])
}
