//! The section with the results: outcomes, errors, figures and reasons of rejection.

use std::collections::BTreeSet;

use crate::{
    content::{
        conditions::columns::{blank, breaks, cells, heads},
        figures,
        phrases::{self, Unit},
        sections::{breakdown, limits, reach},
    },
    document::{Block, Cell, Head, Section, Span, Table, italic, text},
    field::Field,
    paired::Comparison,
    run::Run,
    summary::{Distribution, Row, RunSummary},
};

pub(crate) fn section(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Section {
    let mut section = Section::new("Results");
    section.add(Block::Table(outcomes(run, summary)));
    section.add(Block::Table(errors(run, summary, comparisons)));
    if summary.has_limits() {
        section.blocks.extend(limits::blocks(run, summary));
    }
    let mut plotted = figures::blocks(run, summary);
    // The table of areas follows the figure of recall curves.
    let recall = plotted.iter().position(|block| matches!(block, Block::Figure(figure) if figure.id == "recall"));
    let place = recall.map_or(plotted.len(), |place| place + 1);
    plotted.splice(place..place, reach::table(run, summary));
    section.blocks.extend(breakdown::block(run, summary));
    section.blocks.extend(plotted);
    match refusals(run, summary) {
        Some(table) => {
            section.add(Block::Table(table));
            summary.rejections.iter().for_each(|sentence| section.say(text![sentence.clone()]));
        }
        None => section.say(text!["No attempt was rejected."]),
    }
    section
}

fn outcomes(run: &Run, summary: &RunSummary) -> Table {
    let caption = text![
        "Outcomes. n: attempts, one for every frame and target that the prior puts in view. Rates are in % of n with 95 % intervals. Frames: frames with at least one fix, frames with a wrong fix, all frames. Points: median number of identified points of a fix."
    ];
    let mut above = blank(summary, 1);
    above.extend([Head::over(2, "Fixes"), Head::over(2, "Rejected"), Head::over(2, "Wrong"), Head::over(3, "Frames")]);
    above.push(Head::words(""));
    let mut below = heads(summary);
    below.push(Head::numbers("n"));
    below.extend((0..3).flat_map(|_| ["%", "interval"].map(Head::numbers)));
    below.extend(["with fix", "wrong", "all", "Points"].map(Head::numbers));
    let mut table = Table { id: "outcomes".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let mut line = cells(row);
        line.push(phrases::count(trial, "attempted", row.attempted).into());
        for (group, k) in [("found", row.found), ("refused", row.rejected), ("wrong", row.wrong)] {
            let [low, high] = phrases::interval(trial, group, k, row.attempted);
            line.push(phrases::percent(trial, group, k, row.attempted).into());
            line.push(Cell { text: text!["[", low, ", ", high, "]"], minor: true, ..Cell::default() });
        }
        line.push(phrases::count(trial, "fixed-frames", row.fix_frames).into());
        line.push(phrases::count(trial, "wrong-frames", row.wrong_frames).into());
        line.push(phrases::count(trial, "frames", row.frames).into());
        let points = row.identified.map(|spread| spread.median);
        line.push(phrases::statistic(trial, "median", Field::Identified, "found", points, (Unit::Plain, 0)).into());
        table.line(breaks(summary, index), line);
    }
    table
}

/// A quantity of the table of errors.
struct Column {
    name: &'static str,
    field: Field,
    unit: Unit,
    value: fn(&Row) -> Option<Distribution>,
}

const COLUMNS: [Column; 5] = [
    Column { name: "fit RMS (mm)", field: Field::Fit, unit: Unit::Millimetres, value: |row| row.fit },
    Column {
        name: "fit RMS, unused (mm)",
        field: Field::FitUnused,
        unit: Unit::Millimetres,
        value: |row| row.fit_unused,
    },
    Column { name: "TRE (mm)", field: Field::Tre, unit: Unit::Millimetres, value: |row| row.tre },
    Column {
        name: "position error (mm)",
        field: Field::Position,
        unit: Unit::Millimetres,
        value: |row| row.position_error,
    },
    Column {
        name: "attitude error (°)", field: Field::Attitude, unit: Unit::Degrees, value: |row| row.attitude_error
    },
];

fn errors(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Table {
    let any_best = (0..summary.rows.len()).any(|index| best(comparisons, index));
    let mut caption = text![
        "Errors of the fixes: median and 95 % quantile over n fixes that are not wrong. Fit RMS, unused: the fit RMS over the identified points that the solver did not use. TRE: target registration error. Position and attitude errors are those of the camera. ",
        italic("TRE all"),
        ": median TRE over all attempts, with rejected attempts and wrong fixes counted as infinite errors. ",
    ];
    caption.push(Span::from(match (comparisons.first(), any_best) {
        (None, _) => "No trials are compared, because no two share the same frames.",
        (Some(first), _) if first.between_conditions => "Conditions are compared below, frame by frame.",
        (_, true) => "Bold: significantly better than every other trial on the same frames.",
        _ => "No value is in bold, because no trial is significantly better than all others on the same frames.",
    }));
    if run.trials.iter().any(|trial| trial.every() > 1) {
        caption.push(Span::from(
            " For a trial that logged one frame in k, n counts all frames; the other columns are over the logged frames.",
        ));
    }
    let mut above = blank(summary, 1);
    above.extend(COLUMNS.iter().map(|column| Head::over(2, column.name)));
    above.extend([Head::words(""), Head::words("")]);
    let mut below = heads(summary);
    below.push(Head::numbers("n"));
    below.extend(COLUMNS.iter().flat_map(|_| ["median", "p95"].map(Head::numbers)));
    below.extend([Head::numbers("TRE all (mm)"), Head::numbers("NEES mean")]);
    let digits = COLUMNS.each_ref().map(|column| {
        phrases::decimals(summary.rows.iter().map(|row| (column.value)(row).map(|s| s.median)), column.unit)
    });
    let all_digits = phrases::decimals(summary.rows.iter().map(|row| row.tre_of_all), Unit::Millimetres);
    let mut table = Table { id: "errors".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let mut line = cells(row);
        line.push(phrases::count(trial, "found", row.found).into());
        for (column, &digits) in COLUMNS.iter().zip(&digits) {
            let spread = (column.value)(row);
            let as_number = |name: &str, value: Option<f64>| {
                phrases::statistic(trial, name, column.field, "found", value, (column.unit, digits))
            };
            let median = as_number("median", spread.map(|s| s.median));
            let marked = column.field == Field::Tre && best(comparisons, index);
            line.push(if marked { Span::Best(median).into() } else { median.into() });
            line.push(Cell::minor(as_number("q95", spread.map(|s| s.p95))));
        }
        let unit = (Unit::Millimetres, all_digits);
        line.push(phrases::statistic(trial, "all", Field::Tre, "attempted", row.tre_of_all, unit).into());
        line.push(phrases::statistic(trial, "mean", Field::Nees, "found", row.nees_mean, (Unit::Plain, 2)).into());
        table.line(breaks(summary, index), line);
    }
    table
}

fn refusals(run: &Run, summary: &RunSummary) -> Option<Table> {
    let mut reasons: Vec<String> = summary.rows.iter().flat_map(|row| row.reasons.keys().cloned()).collect();
    reasons.sort();
    reasons.dedup();
    if reasons.is_empty() {
        return None;
    }
    let mut below = heads(summary);
    below.push(Head::numbers("n"));
    below.extend(reasons.iter().map(|reason| Head::numbers(reason.clone())));
    below.push(Head::numbers("all"));
    let mut table = Table::new("refusals", text!["Rejected attempts by reason, of n attempts."], below);
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let mut line = cells(row);
        line.push(phrases::count(trial, "attempted", row.attempted).into());
        for reason in &reasons {
            let n = row.reasons.get(reason).copied().unwrap_or(0);
            line.push(phrases::count(trial, &format!("refused:{reason}"), n).into());
        }
        line.push(phrases::count(trial, "refused", row.rejected).into());
        table.line(breaks(summary, index), line);
    }
    Some(table)
}

/// Whether `index` is significantly better than every trial of its group.
fn best(comparisons: &[Comparison], index: usize) -> bool {
    let is_of = |c: &&Comparison| !c.over_conditions && !c.between_conditions;
    let own: Vec<&Comparison> =
        comparisons.iter().filter(is_of).filter(|c| c.first == index || c.second == index).collect();
    let Some(condition) = own.first().map(|c| &c.condition) else { return false };
    // In a large group each trial is compared with the first only, so no trial is known to be the best.
    let family = comparisons.iter().filter(is_of).filter(|c| c.condition == *condition);
    let members: BTreeSet<usize> = family.flat_map(|c| [c.first, c.second]).collect();
    own.len() + 1 == members.len() && own.iter().all(|c| c.better() == Some(index))
}
