//! The figure of search cost over problem size.

use std::collections::BTreeMap;

use crate::{
    content::{
        figures::layout::{caption, figure, series},
        phrases,
    },
    document::{Cell, Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::distinct,
    number::{Key, Number},
    run::{Run, Trial},
};

/// Maximum number of searches that colour, mark and line can distinguish.
const MAX: usize = 10;
/// Minimum number of attempts of a plotted median.
const MIN: usize = 3;

/// The figure of pair tests and search time over the number of candidates, on logarithmic axes.
///
/// It has times only if durations are logged.
pub(crate) fn search_cost(run: &Run) -> Option<Figure> {
    let names = distinct(run.trials.iter().map(|trial| trial.method()[0].clone()));
    if names.len() > MAX {
        return None;
    }
    let heads = [Head::words("search"), Head::words("cost"), Head::numbers("candidates"), Head::numbers("n")];
    let heads = heads.into_iter().chain(["p5", "median", "p95"].map(Head::numbers));
    let mut data = Table::new("search-cost", text!["The data of the figure of search cost."], heads.collect());
    let mut panels = Vec::new();
    for (field, label, decimals) in [(Field::Tests, "pair tests", 1), (Field::SearchTime, "search (ms)", 4)] {
        let mut layers = Vec::new();
        for name in &names {
            let trials: Vec<&Trial> = run.trials.iter().filter(|trial| trial.method()[0] == *name).collect();
            let (mut line, mut bars) = (Vec::new(), Vec::new());
            for (bin, mut costs) in bins(&trials, field) {
                let [low, middle, high] = [0.05, 0.5, 0.95].map(|p| seafix_evaluation::quantile(&mut costs, p));
                let half_octaves = f64::from(bin) / 2.0;
                let size = 2_f64.powf(half_octaves);
                line.push([size, middle]);
                bars.push([size, low, high]);
                let key = |what: &str| -> Key {
                    let what = format!("{what} {} at {half_octaves} half octaves of candidates", field.name());
                    phrases::over(&trials, field.topic(), what)
                };
                let mut cells: Vec<Cell> = vec![name.clone().into(), label.into(), format!("{size:.1}").into()];
                cells.push(Number::count(costs.len(), key("sampled")).into());
                let as_number = |(what, value)| Number::new(Some(value), decimals, key(what)).into();
                cells.extend([("q5", low), ("median", middle), ("q95", high)].map(as_number));
                data.line(false, cells);
            }
            let series = series(&names, name);
            layers.push(Layer::Whiskers { series, values: bars });
            layers.push(Layer::Line { series, points: line.clone() });
            layers.push(Layer::Marks { series, points: line, radius: 2.0 });
        }
        if layers.iter().any(Layer::draws) {
            let (x, y) = (Axis::logarithmic("candidates of an attempt"), Axis::logarithmic(label));
            panels.push(Panel { x, y, layers, ..Panel::default() });
        }
    }
    let legend = names.iter().enumerate().map(|(index, name)| Entry::both(name.clone(), index)).collect();
    let both = panels.len() > 1;
    let chart = Chart { panels, columns: 2, page: both, shape: 0.8, legend };
    let message = format!(
        "Search cost over the number of candidates: pair tests{}. Points are medians over half octaves with at least {MIN} attempts, bars run from the 5 % to the 95 % quantile. `rigid-consensus` counts words of its graph, of 64 pairs each. Searches that do not count pair tests have no line.",
        if both { " and time" } else { "" }
    );
    figure("search-cost", caption(&message), &chart, data)
}

/// The costs of all attempts, grouped by half octaves of the number of candidates.
fn bins(trials: &[&Trial], field: Field) -> BTreeMap<i32, Vec<f64>> {
    let mut bins: BTreeMap<i32, Vec<f64>> = BTreeMap::new();
    for (_, row) in trials.iter().flat_map(|trial| trial.attempts()) {
        if let (Some(size), Some(cost)) = (row.get(Field::Candidates), row.get(field))
            && size >= 1.0
            && cost > 0.0
        {
            bins.entry((2.0 * size.log2()).round() as i32).or_default().push(cost);
        }
    }
    bins.retain(|_, costs| costs.len() >= MIN);
    bins
}
