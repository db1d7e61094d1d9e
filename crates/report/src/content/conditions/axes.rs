//! Numeric conditions as axes, and series along them.

use crate::{
    format::short,
    summary::{Row, RunSummary},
};

/// The first numeric condition that varies.
pub(crate) fn numeric(summary: &RunSummary) -> Option<String> {
    keys(summary).into_iter().next()
}

/// All numeric conditions that vary. A seed is a name of a repetition, no quantity.
pub(crate) fn keys(summary: &RunSummary) -> Vec<String> {
    let axes = summary.rows.first().into_iter().flat_map(Row::conditions);
    let varies = |key: &String| {
        let values: Vec<Option<f64>> = summary.rows.iter().map(|row| on(row, key)).collect();
        values.iter().all(Option::is_some) && values.iter().any(|value| *value != values[0])
    };
    let quantities = axes.map(|axis| axis.key.clone()).filter(|key| short(key) != "seed");
    quantities.filter(varies).collect()
}

/// The value of a row on an axis.
pub(crate) fn on(row: &Row, key: &str) -> Option<f64> {
    row.axes.iter().find(|axis| axis.key == key).and_then(|axis| axis.value.parse().ok())
}

/// The name of a row's series in a figure over `key`: its method and its other conditions.
pub(crate) fn name(row: &Row, key: &str) -> String {
    let others = row.conditions().filter(|axis| axis.key != key);
    others.fold(row.method(), |name, axis| format!("{name}, {} {}", short(&axis.key), axis.value))
}
