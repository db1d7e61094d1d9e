//! The area under the recall curve, and the error of a fix at lever arms.

use seafix_evaluation::recall_area;

use crate::{
    content::{
        conditions::columns,
        phrases::{self, Unit},
    },
    document::{Block, Cell, Head, Table, Text, text},
    field::Field,
    lever::ARMS,
    number::{Key, Number},
    run::{AttemptRow, Run, Trial},
    summary::{Distribution, RunSummary},
};

/// The errors whose recall is integrated, with the upper bound as printed and its unit.
const AREAS: [(Field, f64, Unit); 2] = [(Field::Tre, 50.0, Unit::Millimetres), (Field::Attitude, 5.0, Unit::Degrees)];

/// The table; `None` without ground truth.
pub(crate) fn table(run: &Run, summary: &RunSummary) -> Option<Block> {
    if !run.trials.iter().any(|trial| AREAS.iter().any(|area| found(trial).any(|row| row.get(area.0).is_some()))) {
        return None;
    }
    let arms: Vec<[Option<Distribution>; 3]> = run
        .trials
        .iter()
        .map(|trial| ARMS.map(|arm| Distribution::of(found(trial).filter_map(|row| row.at_arm(arm)))))
        .collect();
    let known = arms.iter().flatten().any(Option::is_some);
    let mut above = columns::blank(summary, 1);
    above.push(Head::over(2, "area under recall (%)"));
    let mut below = columns::heads(summary);
    below.extend(["n", "TRE to 50 mm", "attitude to 5°"].map(Head::numbers));
    if known {
        above.push(Head::words(""));
        above.extend(ARMS.map(|arm| Head::over(2, format!("at {arm} m (mm)"))));
        below.push(Head::numbers("fixes"));
        below.extend(ARMS.iter().flat_map(|_| ["median", "p95"].map(Head::numbers)));
    }
    let digits: Vec<usize> = (0..ARMS.len())
        .map(|place| phrases::decimals(arms.iter().map(|of| of[place].map(|s| s.median)), Unit::Millimetres))
        .collect();
    let mut table =
        Table { id: "reach".to_owned(), caption: caption(run, known), heads: vec![above, below], lines: Vec::new() };
    for (index, ((row, trial), spreads)) in summary.rows.iter().zip(&run.trials).zip(&arms).enumerate() {
        let mut line = columns::cells(row);
        let attempts = trial.attempts().count();
        line.push(Number::count(attempts, Key::of(trial, "/metrics/evaluation", "count logged")).into());
        line.extend(AREAS.map(|(field, bound, unit)| Cell::from(area(trial, field, bound, unit))));
        if known {
            let as_number = |arm: f64, name: &str, value: Option<f64>, (unit, decimals): (Unit, usize)| {
                let suffix = if unit == Unit::Millimetres { " in mm" } else { "" };
                let key = Key::of(trial, "/referencing/result", format!("{name} arm_{arm} of found{suffix}"));
                Number::new(value.map(|value| value * unit.scale()), decimals, key)
            };
            let count = spreads[0].map_or(0, |spread| spread.count) as f64;
            line.push(as_number(ARMS[0], "sampled", Some(count), (Unit::Plain, 0)).into());
            for ((arm, spread), &digits) in ARMS.into_iter().zip(spreads).zip(&digits) {
                let unit = (Unit::Millimetres, digits);
                line.push(as_number(arm, "median", spread.map(|s| s.median), unit).into());
                line.push(Cell::minor(as_number(arm, "q95", spread.map(|s| s.p95), unit)));
            }
        }
        table.line(columns::breaks(summary, index), line);
    }
    Some(Block::Table(table))
}

fn caption(run: &Run, known: bool) -> Text {
    let mut caption = text![
        "Area under the recall curve: the fraction of all n attempts whose error is below a bound, averaged over the bounds from zero to 50 mm (TRE) and to 5° (attitude error). It is 100 % for fixes without error; rejected attempts and wrong fixes contribute nothing."
    ];
    if known {
        caption.push(" At 1, 2 and 5 m: position error at a point that far from the centroid of the points that a fix used, with the effect of the rotation, RMS over all directions.".into());
    }
    if run.trials.iter().any(|trial| trial.every() > 1) {
        caption.push(" For a trial that logged one frame in k, the values are over the logged frames.".into());
    }
    caption
}

fn found(trial: &Trial) -> impl Iterator<Item = &AttemptRow> {
    trial.attempts().map(|(_, row)| row).filter(|row| row.found())
}

/// The area in percent; no value where a fix has no error.
fn area(trial: &Trial, field: Field, bound: f64, unit: Unit) -> Number {
    let suffix = if unit == Unit::Degrees { "deg" } else { "mm" };
    let what = format!("area {}<={bound} of attempted in {suffix}", field.name());
    let errors: Vec<f64> = trial.attempts().map(|(_, row)| row.error_or_failure(field)).collect();
    let known = !errors.is_empty() && found(trial).all(|row| row.get(field).is_some());
    let area = known.then(|| 100.0 * recall_area(&errors, bound / unit.scale()));
    Number::new(area, 1, Key::of(trial, field.topic(), what))
}
