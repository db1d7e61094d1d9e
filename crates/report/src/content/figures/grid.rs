//! The figure of the fix rate over two conditions.

use crate::{
    content::{
        conditions::axes,
        figures::layout::{self, caption},
        phrases,
    },
    document::{Cell, Figure, Head, Table, text},
    figure::{Axis, Chart, Layer, Panel},
    format::{distinct, headed},
    run::Run,
    summary::{Row, RunSummary},
};

/// The heat maps of the fix rate, one for every method, over the first two numeric conditions.
///
/// Runs without them use their only two axes, with one trial in every cell.
pub(crate) fn figure(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let numeric = axes::keys(summary);
    let keys = if numeric.len() < 2 { varying(summary) } else { numeric };
    let [first, second] = keys.get(..2)? else { return None };
    let others = |index: usize| {
        let row = &summary.rows[index];
        let others = row.axes.iter().filter(|axis| axis.key != *first && axis.key != *second);
        let others: Vec<&str> = others.map(|axis| axis.value.as_str()).collect();
        if others.is_empty() { String::new() } else { others.join(", ") }
    };
    let names = distinct((0..summary.rows.len()).map(others));
    let (columns, lines) = (ticks(summary, first), ticks(summary, second));
    if names.len() > 9 || columns.len() * lines.len() * names.len() != summary.rows.len() {
        return None;
    }
    let head = |key: &str| {
        let numbers = summary.rows.iter().all(|row| axes::on(row, key).is_some());
        Head { numbers, ..Head::words(headed(key)) }
    };
    let heads = vec![Head::words("series"), head(first), head(second), Head::numbers("fixes (%)")];
    let mut data = Table::new("success", text!["The data of the figure of fix rates over two conditions."], heads);
    let mut panels = Vec::new();
    for name in &names {
        let mut values = Vec::new();
        for (index, row) in summary.rows.iter().enumerate().filter(|(index, _)| others(*index) == *name) {
            let at = |key: &str, ticks: &[String]| ticks.iter().position(|tick| *tick == value(row, key));
            let (x, y) = (at(first, &columns)? as f64, at(second, &lines)? as f64);
            let fraction = row.found as f64 / row.attempted.max(1) as f64;
            let number = phrases::percent(&run.trials[index], "found", row.found, row.attempted);
            values.push(([x, y, fraction], format!("{:.0}", 100.0 * fraction)));
            let place = |key: &str| match axes::on(row, key) {
                Some(number) => Cell::from(phrases::axis(&run.trials[index], key, Some(number))),
                None => value(row, key).into(),
            };
            data.line(false, vec![name.clone().into(), place(first), place(second), number.into()]);
        }
        let (x, y) = (Axis::named(headed(first), columns.clone()), Axis::named(headed(second), lines.clone()));
        panels.push(Panel { title: name.clone(), x, y, layers: vec![Layer::Heat { values }], equal: false });
    }
    let page = panels.len() > 1 || columns.len() > 6;
    let shape = (0.16 + 0.06 * lines.len() as f64).clamp(0.3, 0.8);
    let chart = Chart {
        columns: panels.len().min(3),
        page,
        shape: if panels.len() > 1 { 0.8 } else { shape * if page { 1.0 } else { 1.6 } },
        panels,
        legend: Vec::new(),
    };
    layout::figure("success", caption("Fix rate (fixes in % of the attempts) over two conditions."), &chart, data)
}

/// The two axes along which trials differ; `None` if their number is not two.
fn varying(summary: &RunSummary) -> Vec<String> {
    let axes = summary.rows.first().map(|row| row.axes.clone()).unwrap_or_default();
    let differs = |key: &String| summary.rows.iter().any(|row| value(row, key) != value(&summary.rows[0], key));
    let keys: Vec<String> = axes.into_iter().map(|axis| axis.key).filter(differs).collect();
    if keys.len() == 2 { keys } else { Vec::new() }
}

fn value(row: &Row, key: &str) -> String {
    row.axes.iter().find(|axis| axis.key == key).map_or_else(String::new, |axis| axis.value.clone())
}

/// The values of an axis: numbers in increasing order, words in order of appearance.
fn ticks(summary: &RunSummary, key: &str) -> Vec<String> {
    let mut values = distinct(summary.rows.iter().map(|row| value(row, key)));
    if summary.rows.iter().all(|row| axes::on(row, key).is_some()) {
        let number = |text: &String| text.parse::<f64>().unwrap_or(0.0);
        values.sort_by(|a, b| number(a).total_cmp(&number(b)));
    }
    values
}
