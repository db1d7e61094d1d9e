//! The figure of the rates of fixes and wrong fixes, one line for every trial.

use crate::{
    content::{
        figures::layout::{self, caption},
        phrases,
    },
    document::{Figure, Head, Table, Text, text},
    figure::{Axis, Chart, Entry, Layer, Panel},
    proportion,
    run::{Run, Trial},
    summary::{Row, RunSummary},
};

/// Maximum number of trials in the figure.
const MAX: usize = 36;

/// The sentence in place of figures of rates that are 100 % or 0 % in every trial; `None` for other runs.
pub(crate) fn uniform(run: &Run, summary: &RunSummary) -> Option<Text> {
    let rows = || summary.rows.iter().filter(|row| row.attempted > 0);
    let all = |is: fn(&Row) -> bool| rows().next().is_some() && rows().all(is);
    let trials: Vec<&Trial> = run.trials.iter().collect();
    let n = phrases::pooled_count(&trials, "attempted", rows().map(|row| row.attempted).sum());
    if all(|row| row.found == row.attempted) {
        return Some(text!["All ", n, " attempts have a fix, in every trial, and none is wrong."]);
    }
    all(|row| row.rejected == row.attempted).then(|| text!["None of ", n, " attempts has a fix, in any trial."])
}

/// The figure: rates of fixes and wrong fixes among the attempts, with 95 % intervals.
pub(crate) fn figure(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let n = summary.rows.len();
    if !(2..=MAX).contains(&n) {
        return None;
    }
    let heads =
        [Head::words("trial"), Head::words("outcome"), Head::numbers("%"), Head::numbers("low"), Head::numbers("high")];
    let mut data = Table::new("rates", text!["The data of the figure of rates."], heads.to_vec());
    let mut layers = Vec::new();
    for (series, group) in ["found", "wrong"].into_iter().enumerate() {
        let (mut spans, mut marks) = (Vec::new(), Vec::new());
        for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
            let k = if series == 0 { row.found } else { row.wrong };
            let fraction = phrases::percent(trial, group, k, row.attempted);
            let [low, high] = phrases::interval(trial, group, k, row.attempted);
            let at = (n - 1 - index) as f64 + if series == 0 { 0.14 } else { -0.14 };
            if let (Some(fraction), Some(low), Some(high)) = (fraction.value, low.value, high.value) {
                spans.push([at, low, high]);
                marks.push([fraction, at]);
            }
            let name = RunSummary::name(run, trial);
            let outcome = phrases::outcome(group).into();
            data.line(false, vec![name.into(), outcome, fraction.into(), low.into(), high.into()]);
        }
        layers.push(Layer::Spans { series, values: spans });
        layers.push(Layer::Marks { series, points: marks, radius: 2.2 });
    }
    let names = run.trials.iter().rev().map(|trial| RunSummary::name(run, trial)).collect();
    let panel = Panel {
        x: Axis::linear("attempts (%)").within([-1.0, 101.0]),
        y: Axis::named("", names),
        layers,
        ..Panel::default()
    };
    let shape = ((n as f64 * 15.0 + 34.0) / 482.0).clamp(0.16, 1.2);
    let legend = vec![Entry::mark("fixes", 0), Entry::mark("wrong fixes", 1)];
    let chart = Chart { panels: vec![panel], columns: 1, page: true, shape, legend };
    let intervals = proportion::called(run.trials.iter().map(|trial| &trial.header));
    let message =
        format!("Fixes and wrong fixes in % of the attempts, with {intervals}. The remaining attempts were rejected.");
    layout::figure("rates", caption(&message), &chart, data)
}
