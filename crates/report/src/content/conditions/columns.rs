//! The columns that identify a trial in a table: its method and its conditions.

use crate::{
    document::{Cell, Head},
    format::headed,
    summary::{Row, RunSummary},
};

/// The heads of the columns that identify a trial.
pub(crate) fn heads(summary: &RunSummary) -> Vec<Head> {
    let conditions = summary.rows.first().into_iter().flat_map(Row::conditions);
    let numeric = |key: &str| {
        summary
            .rows
            .iter()
            .flat_map(Row::conditions)
            .filter(|axis| axis.key == key)
            .all(|axis| axis.value.parse::<f64>().is_ok())
    };
    [Head::words("Method")]
        .into_iter()
        .chain(conditions.map(|axis| Head { numbers: numeric(&axis.key), ..Head::words(headed(&axis.key)) }))
        .collect()
}

/// The cells that identify the trial of `row`.
pub(crate) fn cells(row: &Row) -> Vec<Cell> {
    let conditions = row.conditions().map(|axis| axis.value.clone().into());
    [row.method().into()].into_iter().chain(conditions).collect()
}

/// Whether a thin rule separates row `index` from the one above: the first condition changes there.
pub(crate) fn breaks(summary: &RunSummary, index: usize) -> bool {
    let first = |index: usize| summary.rows[index].conditions().next().map(|axis| &axis.value);
    index > 0 && first(index) != first(index - 1)
}

/// Empty heads above the columns that identify a trial and `more` columns beside them.
pub(crate) fn blank(summary: &RunSummary, more: usize) -> Vec<Head> {
    vec![Head::words(""); heads(summary).len() + more]
}
