//! Success over two conditions at once.

use super::{axis, caption, distinct};
use crate::{
    Summary,
    content::tell,
    document::{Figure, Head, Table, text},
    figure::{Axis, Chart, Layer, Panel},
    format::headed,
    run::Run,
};

/// A heat map a method over the first two conditions with numbers, where every cell is one trial.
pub(super) fn figure(run: &Run, summary: &Summary) -> Option<Figure> {
    let keys = axis::keys(summary);
    let [first, second] = keys.get(..2)? else { return None };
    let others = |index: usize| {
        let row = &summary.rows[index];
        let others = row.conditions().filter(|axis| axis.key != *first && axis.key != *second);
        others.fold(row.method(), |name, axis| format!("{name}, {}", axis.value))
    };
    let names = distinct((0..summary.rows.len()).map(others));
    let ticks = |key: &str| {
        let mut values: Vec<f64> = summary.rows.iter().filter_map(|row| axis::on(row, key)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let (columns, lines) = (ticks(first), ticks(second));
    if names.len() > 9 || columns.len() * lines.len() * names.len() != summary.rows.len() {
        return None;
    }
    let heads = vec![
        Head::words("series"),
        Head::numbers(headed(first)),
        Head::numbers(headed(second)),
        Head::numbers("found (%)"),
    ];
    let mut data = Table::new("success", text!["Every cell of the figure of success."], heads);
    let mut panels = Vec::new();
    for name in &names {
        let mut values = Vec::new();
        for (index, row) in summary.rows.iter().enumerate().filter(|(index, _)| others(*index) == *name) {
            let at = |key: &str, ticks: &[f64]| ticks.iter().position(|tick| Some(*tick) == axis::on(row, key));
            let (x, y) = (at(first, &columns)? as f64, at(second, &lines)? as f64);
            let share = row.found as f64 / row.attempted.max(1) as f64;
            let number = tell::percent(&run.trials[index], "found", row.found, row.attempted);
            values.push(([x, y, share], format!("{:.0}", 100.0 * share)));
            let place = |key: &str| tell::axis(&run.trials[index], key, axis::on(row, key)).into();
            data.line(false, vec![name.clone().into(), place(first), place(second), number.into()]);
        }
        let labels = |ticks: &[f64]| ticks.iter().map(|tick| crate::format::trimmed(*tick)).collect();
        let (x, y) = (Axis::named(headed(first), labels(&columns)), Axis::named(headed(second), labels(&lines)));
        panels.push(Panel { title: name.clone(), x, y, layers: vec![Layer::Heat { values }], equal: false });
    }
    let chart = Chart { columns: panels.len().min(3), page: panels.len() > 1, shape: 0.8, panels, legend: Vec::new() };
    super::figure("success", caption("Share of the attempts found, in %, over two conditions.", run), &chart, data)
}
