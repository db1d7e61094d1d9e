//! The small table of the first page: rates and errors with their intervals, one line for every trial.
//!
//! A longer run has a [`grid`] of its two conditions, or a line for every series.

use super::{
    cells::{LINES, rate_of, without_unit},
    contrast::Contrast,
    grid,
    kind::{Asked, Kind},
    limited,
    measured::{Sample, error, median, navigated_rms},
};
use crate::{
    content::{
        conditions::labels::{Labels, value},
        phrases::{self, Unit},
        sections::navigation,
    },
    document::{Block, Cell, Head, Table, text},
    navigation_quantity::NavigationQuantity,
    run::Run,
    summary::RunSummary,
};

/// The table; `None` if even the series are too many, or nothing was attempted.
pub(super) fn block(run: &Run, summary: &RunSummary) -> Option<Block> {
    if summary.rows.iter().all(|row| row.attempted == 0) {
        return None;
    }
    let kind = Kind::of(run, summary);
    if let Kind::Acceptance(key) = &kind {
        return limited::table(run, summary, key);
    }
    let labels = Labels::of(summary);
    if summary.rows.len() > LINES
        && let Some(grid) = grid::table(run, summary, &labels, &kind)
    {
        return Some(grid);
    }
    let lines: Vec<(String, Vec<usize>)> = match summary.rows.len() <= LINES {
        true => (0..summary.rows.len()).map(|index| (labels.of_trial(&summary.rows[index]), vec![index])).collect(),
        false => labels.series(summary),
    };
    (lines.len() <= LINES).then(|| Block::Table(table(run, summary, lines)))
}

fn table(run: &Run, summary: &RunSummary, lines: Vec<(String, Vec<usize>)>) -> Table {
    let single = lines.iter().all(|(_, members)| members.len() == 1);
    let navigates = run.trials.iter().any(navigation::navigates);
    let contrast = Contrast { run, summary };
    let bases = bases(summary);
    let changes = |index: usize| contrast.of_rates(&[index], &[bases[index]], 0.95);
    let others = || lines.iter().map(|(_, own)| own[0]).filter(|&index| bases[index] != index);
    let compared = single
        && !navigates
        && others().count() > 0
        && others().all(|index| changes(index).is_some())
        && others().any(|index| changes(index).is_some_and(|change| change.value != 0.0));
    let mut heads = vec![Head::words(""), Head::numbers("attempts"), Head::numbers("fixes (%)")];
    if compared {
        heads.push(Head::numbers("change (points)"));
    }
    heads.push(Head::numbers("wrong"));
    if single {
        let what = if navigates { "error of fixes" } else { error(summary).0 };
        heads.push(Head::numbers(format!("median {what} (mm)")));
    }
    let drifts = navigates && single && Asked::of(&summary.question).drift;
    if navigates && single {
        heads.extend(["navigated error RMS (mm)", "odometry alone RMS (mm)"].map(Head::numbers));
    }
    if drifts {
        heads.push(Head::numbers("drift between fixes (mm/m)"));
    }
    let errors = match (single, navigates) {
        (true, true) => {
            ", median errors of the fixes, and RMS errors of the navigated pose and of odometry alone from the first fix"
        }
        (true, false) => " and median errors of the fixes",
        _ => "",
    };
    let change = match compared {
        true if bases.iter().all(|&base| base == 0) => {
            " Change: the difference of the rate from that of the first line, over the attempts made in both; each interval holds alone, whereas “significant” accounts for all comparisons of a sentence."
        }
        true => {
            " Change: the difference of the rate from that of the dash above, over the attempts made in both; each interval holds alone, whereas “significant” accounts for all comparisons of a sentence."
        }
        false => "",
    };
    let caption = format!(
        "Fixes in % of the attempts{errors}, with 95 % intervals. An attempt is a frame in which a fix is tried, and a target with enough features in view by the prior.{change}"
    );
    let mut table = Table::new("answer", text![caption], heads);
    for (name, members) in lines {
        let sample = Sample::of(run, summary, &members);
        let mut cells: Vec<Cell> = vec![name.into(), sample.n().into()];
        cells.push(Cell { text: rate_of(&sample, sample.measured()), ..Cell::default() });
        if compared {
            let (own, base) = (members[0], bases[members[0]]);
            cells.push(match changes(own).filter(|_| own != base) {
                Some(change) => {
                    let [_, value, low, high] = contrast.numbers([&[own], &[base]], "found", (change, Unit::Plain, 1));
                    Cell { text: text![value, " [", low, ", ", high, "]"], ..Cell::default() }
                }
                None => "–".into(),
            });
        }
        cells.push(phrases::pooled_count(&sample.trials, "wrong", sample.wrong).into());
        if let ([index], true) = (&members[..], single) {
            let known = (error(summary).2)(&summary.rows[*index]).is_some();
            let shown = if known { without_unit(median(summary, &run.trials[*index])) } else { text!["–"] };
            cells.push(Cell { text: shown, ..Cell::default() });
            if navigates {
                let trial = &run.trials[*index];
                for quantity in [NavigationQuantity::Position, NavigationQuantity::AlonePosition] {
                    let rms = navigated_rms(trial, quantity, trial.span());
                    let shown = if rms.value().is_nan() { text!["–"] } else { without_unit(rms.text()) };
                    cells.push(Cell { text: shown, ..Cell::default() });
                }
            }
            if drifts {
                let drift = navigation::drift_per_metre(&run.trials[*index]);
                let shown =
                    drift.map_or_else(|| text!["–"], |[all, low, high, _]| text![all, " (", low, " to ", high, ")"]);
                cells.push(Cell { text: shown, ..Cell::default() });
            }
        }
        table.line(false, cells);
    }
    table
}

/// The trial that each trial is compared with: the first at the same place of the axis, or the first of a single series.
fn bases(summary: &RunSummary) -> Vec<usize> {
    let labels = Labels::of(summary);
    let place = |index: usize| labels.along.as_ref().map(|key| value(&summary.rows[index], key));
    let series = labels.series(summary).len();
    let base = |index: usize| match series {
        1 => 0,
        _ => (0..index).find(|&other| place(other) == place(index)).unwrap_or(index),
    };
    (0..summary.rows.len()).map(base).collect()
}
