//! Break-down points: the value of a condition up to which a method keeps its fix rate.

use crate::{
    content::{conditions::axes, phrases},
    document::{Block, Cell, Head, Table, text},
    format::{distinct, harder, headed},
    number::{Key, Number},
    proportion::BORNE,
    run::{Run, Trial},
    summary::{Row, RunSummary},
};

/// A value of the condition with the results of its trial.
pub(crate) type Step<'a> = (f64, &'a Row, &'a Trial);

/// The table of break-down points: one line for every series along every axis whose larger values are harder.
///
/// A sentence replaces it where no series reaches [`BORNE`] anywhere; `None` without such an axis.
pub(crate) fn block(run: &Run, summary: &RunSummary) -> Option<Block> {
    let heads = vec![
        Head::words("series"),
        Head::words("along"),
        Head::numbers("from"),
        Head::numbers("to"),
        Head::numbers("break-down point"),
        Head::numbers("fix rate there (%)"),
        Head::numbers("interval"),
        Head::numbers("conservative"),
    ];
    let caption = text![format!(
        "Break-down points: the largest value up to which the fix rate is at least {BORNE} % at every tested value. Conservative: the same for the lower end of the 95 % interval of the fix rate, which is low for few attempts. ≥: no larger value was tested; –: the fix rate is lower at the smallest value already."
    )];
    let mut table = Table::new("breakdown", caption, heads);
    let mut any = false;
    for key in axes::keys(summary).into_iter().filter(|key| harder(key)) {
        let names = distinct(summary.rows.iter().map(|row| axes::name(row, &key)));
        for (place, name) in names.iter().enumerate() {
            let own = summary.rows.iter().zip(&run.trials).filter(|(row, _)| axes::name(row, &key) == *name);
            let mut steps: Vec<Step<'_>> =
                own.filter_map(|(row, trial)| Some((axes::on(row, &key)?, row, trial))).collect();
            steps.sort_by(|a, b| a.0.total_cmp(&b.0));
            if steps.len() < 2 {
                continue;
            }
            let (line, borne) = line(name, &key, &steps);
            any |= borne;
            table.line(place == 0 && !table.lines.is_empty(), line);
        }
    }
    if table.lines.is_empty() {
        return None;
    }
    Some(match any {
        true => Block::Table(table),
        false => Block::Paragraph(text![format!(
            "Break-down point: the fix rate is below {BORNE} % at every value of {}, even the smallest.",
            axes::keys(summary)
                .iter()
                .filter(|key| harder(key))
                .map(|key| headed(key))
                .collect::<Vec<_>>()
                .join(" or ")
        )]),
    })
}

/// The rate of fixes at a step (%), or an end of its interval: `percent`, `low`, `high`.
fn fraction(end: &str, (_, row, trial): &Step<'_>) -> Number {
    phrases::rate(trial, end, "found", (row.found, row.attempted), 1)
}

/// The number of decimals of the value of a step.
fn digits((_, row, _): &Step<'_>, key: &str) -> usize {
    let axis = row.axes.iter().find(|axis| axis.key == key);
    axis.and_then(|axis| axis.value.split_once('.')).map_or(0, |(_, decimals)| decimals.len())
}

/// The break-down point of a series by the rate of fixes (`percent`) or the lower end of its interval (`low`).
///
/// The steps are in order of their values. The result has the number of steps up to the point, and the point.
pub(crate) fn point(steps: &[Step<'_>], key: &str, end: &str) -> (usize, Number) {
    let trials: Vec<&Trial> = steps.iter().map(|step| step.2).collect();
    let borne =
        steps.iter().take_while(|step| fraction(end, step).value.is_some_and(|fraction| fraction >= BORNE)).count();
    let last = borne.checked_sub(1).map(|last| &steps[last]);
    let what = if end == "low" { "surely-borne" } else { "borne" };
    let what = phrases::over(&trials, "/metrics/evaluation", format!("{what} found along {key}"));
    (borne, Number::new(last.map(|step| step.0), last.map_or(0, |step| digits(step, key)), what))
}

/// The line of one series, and whether it has a break-down point.
fn line(name: &str, key: &str, steps: &[Step<'_>]) -> (Vec<Cell>, bool) {
    let borne = |end: &str| {
        let (borne, number) = point(steps, key, end);
        let open = if borne == steps.len() { "≥ " } else { "" };
        (
            borne,
            if open.is_empty() { Cell::from(number) } else { Cell { text: text![open, number], ..Cell::default() } },
        )
    };
    let axis = |step: &Step<'_>| {
        let number = phrases::axis(step.2, key, Some(step.0));
        Cell::from(Number::new(number.value, digits(step, key), Key::clone(&number.key)))
    };
    let ((n, largest), (_, surely)) = (borne("percent"), borne("low"));
    let mut cells = vec![name.to_owned().into(), headed(key).into(), axis(&steps[0]), axis(&steps[steps.len() - 1])];
    cells.push(largest);
    match n.checked_sub(1).map(|last| &steps[last]) {
        Some(step) => {
            let [low, high] = phrases::interval(step.2, "found", step.1.found, step.1.attempted);
            cells.push(fraction("percent", step).into());
            cells.push(Cell { text: text!["[", low, ", ", high, "]"], minor: true, ..Cell::default() });
        }
        None => cells.extend(["–", "–"].map(Cell::from)),
    }
    cells.push(surely);
    (cells, n > 0)
}
