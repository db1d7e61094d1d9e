//! The table of a run over two conditions: a line for each value of one, a column for each of the other.

use super::{cells::LINES, cost, kind::Kind, limits, measured::Sample};
use crate::{
    content::conditions::labels::{Labels, value},
    document::{Block, Cell, Head, Table, Text, text},
    format::{distinct, placed},
    proportion,
    run::Run,
    summary::{Row, RunSummary},
};

/// Maximum number of columns that fit the page.
const COLUMNS: usize = 9;

/// The table; `None` unless every value of one condition was run with every value of the other.
pub(super) fn table(run: &Run, summary: &RunSummary, labels: &Labels, kind: &Kind) -> Option<Block> {
    let other = |row: &Row| -> String {
        let keys = row.axes.iter().filter(|axis| !labels.apart.contains(&axis.key));
        let varies = keys.filter(|axis| summary.rows.iter().any(|other| value(other, &axis.key) != axis.value));
        let named = varies.map(|axis| match axis.value.parse::<f64>() {
            Ok(_) => placed(&axis.key, &axis.value),
            Err(_) => axis.value.clone(),
        });
        named.collect::<Vec<_>>().join(", ")
    };
    // The methods of limits are solvers in several conditions.
    let name = |row: &Row| if matches!(kind, Kind::Limits) { row.solver.clone() } else { labels.of_series(row) };
    let place = |row: &Row| if matches!(kind, Kind::Limits) { condition(row, summary) } else { other(row) };
    let names = distinct(summary.rows.iter().map(name));
    let places = distinct(summary.rows.iter().map(place));
    let grid = names.len() * places.len() == summary.rows.len() && names.len() > 1 && places.len() > 1;
    let across = if names.len() < places.len() { &names } else { &places };
    let down = if names.len() < places.len() { &places } else { &names };
    if !grid || across.len() > COLUMNS || down.len() > LINES {
        return None;
    }
    let at = |line: &String, column: &String| {
        let (own, there) = if names.len() < places.len() { (column, line) } else { (line, column) };
        (0..summary.rows.len()).find(|&index| {
            let row = &summary.rows[index];
            name(row) == *own && place(row) == *there
        })
    };
    let mut heads = vec![Head::words("")];
    heads.extend(across.iter().map(|column| Head::numbers(column.clone())));
    let mut table = Table::new("answer", text![caption(run, summary, kind)], heads);
    for line in down {
        let mut cells: Vec<Cell> = vec![line.clone().into()];
        for column in across {
            let text = at(line, column).map_or_else(|| text!["–"], |index| cell(run, summary, kind, index));
            cells.push(Cell { text, ..Cell::default() });
        }
        table.line(false, cells);
    }
    Some(Block::Table(table))
}

/// The values of all axes but the solver.
fn condition(row: &Row, summary: &RunSummary) -> String {
    let own = row.axes.iter().filter(|axis| axis.value != row.solver);
    let varies = own.filter(|axis| summary.rows.iter().any(|other| value(other, &axis.key) != axis.value));
    varies.map(crate::format::condition).collect::<Vec<_>>().join(", ")
}

fn caption(run: &Run, summary: &RunSummary, kind: &Kind) -> String {
    match kind {
        Kind::Cost => {
            "The median number of pair tests over all attempts, solved or not (of `rigid-consensus`, words of its graph, of 64 pairs each); a search that reaches its limit of work ends there. A dash: no attempt is solved.".to_owned()
        }
        Kind::Limits => {
            "RMS camera position error / RMS error of the model points (TRE), in multiples of their Cramér–Rao bounds."
                .to_owned()
        }
        _ => {
            let counts = || summary.rows.iter().map(|row| row.attempted);
            let (min, max) = (counts().min().unwrap_or(0), counts().max().unwrap_or(0));
            let attempts = if min == max { min.to_string() } else { format!("{min} to {max}") };
            let successive = run.trials.iter().any(|trial| proportion::is_trajectory(&trial.header));
            let (low, high) = proportion::interval_of_counts(successive, min / 2, min);
            format!(
                "Fixes in % of the {attempts} attempts of each cell; the number of wrong fixes in brackets. A rate of 50 % has the 95 % interval [{:.0}, {:.0}].",
                100.0 * low,
                100.0 * high
            )
        }
    }
}

fn cell(run: &Run, summary: &RunSummary, kind: &Kind, index: usize) -> Text {
    match kind {
        Kind::Cost if summary.rows[index].found == 0 => text!["–"],
        Kind::Cost => cost::tests(&run.trials[index]),
        Kind::Limits => limits::ratios(&run.trials[index], &summary.rows[index]),
        _ => {
            let sample = Sample::of(run, summary, &[index]);
            if sample.attempted == 0 {
                return text!["–"];
            }
            let mut message = text![sample.measured().number()];
            if sample.wrong > 0 {
                message.extend(text![" (", sample.wrong_count(), ")"]);
            }
            message
        }
    }
}
