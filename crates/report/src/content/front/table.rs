//! The small table of the first page: rates and errors with their intervals, one line for every trial or series.

use super::measured::{Sample, error, median};
use crate::{
    content::{
        conditions::labels::Labels,
        phrases::{self, Unit},
        sections::navigation,
    },
    document::{Block, Cell, Head, Table, text},
    navigation_quantity::NavigationQuantity,
    run::Run,
    summary::RunSummary,
};

/// Maximum number of lines; a longer run has a line for every series.
const LINES: usize = 12;

/// The table; `None` if even the series are too many, or nothing was attempted.
pub(super) fn block(run: &Run, summary: &RunSummary) -> Option<Block> {
    let labels = Labels::of(summary);
    let trials = || -> Vec<(String, Vec<usize>)> {
        (0..summary.rows.len()).map(|index| (labels.of_trial(&summary.rows[index]), vec![index])).collect()
    };
    let lines: Vec<(String, Vec<usize>)> = if summary.rows.len() <= LINES { trials() } else { labels.series(summary) };
    if lines.len() > LINES || summary.rows.iter().all(|row| row.attempted == 0) {
        return None;
    }
    let single = lines.iter().all(|(_, members)| members.len() == 1);
    let navigates = run.trials.iter().any(navigation::navigates);
    let mut heads = vec![Head::words(""), Head::numbers("attempts"), Head::numbers("fixes (%)")];
    heads.push(Head::numbers("wrong"));
    if single {
        heads.push(Head::numbers(format!(
            "median {} (mm)",
            if navigates { "error of fixes" } else { error(summary).0 }
        )));
    }
    if navigates && single {
        heads.push(Head::numbers("navigated error RMS (mm)"));
    }
    let errors = if single { " and median errors" } else { "" };
    let caption = text![format!("Fixes in % of the attempts{errors}, with 95 % intervals.")];
    let mut table = Table::new("answer", caption, heads);
    for (name, members) in lines {
        let sample = Sample::of(run, summary, &members);
        let mut cells: Vec<Cell> = vec![name.into(), sample.n().into()];
        cells.push(Cell { text: percent(&sample), ..Cell::default() });
        cells.push(phrases::pooled_count(&sample.trials, "wrong", sample.wrong).into());
        if let ([index], true) = (&members[..], single) {
            let known = (error(summary).2)(&summary.rows[*index]).is_some();
            let shown = if known { without_unit(median(summary, &run.trials[*index])) } else { text!["–"] };
            cells.push(Cell { text: shown, ..Cell::default() });
            if navigates {
                let trial = &run.trials[*index];
                let rms = navigation::statistic(trial, "rms", NavigationQuantity::Position, Unit::Millimetres);
                cells.push(rms.into());
            }
        }
        table.line(false, cells);
    }
    Some(Block::Table(table))
}

/// The rate without its sign; a dash without attempts.
fn percent(sample: &Sample<'_>) -> crate::document::Text {
    if sample.attempted == 0 { text!["–"] } else { without_unit(sample.rate()) }
}

/// A measured value whose unit the head of its column states.
fn without_unit(text: crate::document::Text) -> crate::document::Text {
    let strip = |span| match span {
        crate::document::Span::Plain(words) => crate::document::Span::Plain(words.replace(" mm", "").replace(" %", "")),
        span => span,
    };
    text.into_iter().map(strip).collect()
}
