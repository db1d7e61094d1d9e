//! The small table of the first page: rates and errors with their intervals, one line for every trial or series.

use super::{
    acceptance,
    kind::Kind,
    measured::{Measured, Sample, error, median, navigated_rms},
};
use crate::{
    content::{conditions::labels::Labels, phrases, sections::navigation},
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
    let lines: Vec<(String, Vec<usize>)> = match Kind::of(run, summary) {
        Kind::Acceptance(key) => acceptance::limits(summary, &key),
        _ if summary.rows.len() <= LINES => trials(),
        _ => labels.series(summary),
    };
    if lines.len() > LINES || summary.rows.iter().all(|row| row.attempted == 0) {
        return None;
    }
    let single = lines.iter().all(|(_, members)| members.len() == 1);
    let navigates = run.trials.iter().any(navigation::navigates);
    let mut heads = vec![Head::words(""), Head::numbers("attempts"), Head::numbers("fixes (%)")];
    let rated = matches!(Kind::of(run, summary), Kind::Acceptance(_));
    heads.push(Head::numbers(if rated { "wrong (%)" } else { "wrong" }));
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
    let wrong = if rated { " and wrong fixes" } else { "" };
    let caption = text![format!("Fixes{wrong} in % of the attempts{errors}, with 95 % intervals.")];
    let mut table = Table::new("answer", caption, heads);
    for (name, members) in lines {
        let sample = Sample::of(run, summary, &members);
        let mut cells: Vec<Cell> = vec![name.into(), sample.n().into()];
        cells.push(Cell { text: of_attempts(&sample, sample.measured()), ..Cell::default() });
        cells.push(match rated {
            true => Cell { text: of_attempts(&sample, sample.wrong_rate()), ..Cell::default() },
            false => phrases::pooled_count(&sample.trials, "wrong", sample.wrong).into(),
        });
        if let ([index], true) = (&members[..], single) {
            let known = (error(summary).2)(&summary.rows[*index]).is_some();
            let shown = if known { without_unit(median(summary, &run.trials[*index])) } else { text!["–"] };
            cells.push(Cell { text: shown, ..Cell::default() });
            if navigates {
                let trial = &run.trials[*index];
                let rms = navigated_rms(trial, NavigationQuantity::Position, trial.span());
                let shown = if rms.value().is_nan() { text!["–"] } else { without_unit(rms.text()) };
                cells.push(Cell { text: shown, ..Cell::default() });
            }
        }
        table.line(false, cells);
    }
    Some(Block::Table(table))
}

/// The rate without its sign; a dash without attempts.
fn of_attempts(sample: &Sample<'_>, rate: Measured) -> crate::document::Text {
    if sample.attempted == 0 { text!["–"] } else { without_unit(rate.text()) }
}

/// A measured value whose unit the head of its column states.
fn without_unit(text: crate::document::Text) -> crate::document::Text {
    let strip = |span| match span {
        crate::document::Span::Plain(words) => {
            crate::document::Span::Plain(words.replace(" mm RMS", "").replace(" mm", "").replace(" %", ""))
        }
        span => span,
    };
    text.into_iter().map(strip).collect()
}
