//! The answer to an experiment's question: one sentence for every quantity or series.

use crate::{
    content::{
        conditions::labels::{Labels, value},
        phrases::{self, Unit},
        sections::{inspection, navigation, objects, significance},
    },
    document::{Span, Text, text},
    field::Field,
    format::distinct,
    number::Number,
    paired::Comparison,
    run::{Run, Trial},
    summary::{Distribution, Limits, Row, RunSummary},
};

/// Maximum number of trials that are listed one by one; more are summed up by series.
const REPORTED: usize = 9;
/// Maximum number of significant differences that get a sentence.
const DIFFERENCES: usize = 3;

/// The sentences of the answer, in order.
pub(crate) fn sentences(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Vec<Text> {
    let labels = Labels::of(summary);
    let name = |index: usize| labels.of_trial(&summary.rows[index]);
    let mut message = navigation::sentences(run, &name);
    message.extend(inspection::sentences(run, &name));
    message.extend(objects::sentences(run, &name));
    if !message.is_empty() {
        message.extend(wrong(run, summary, &labels));
        return message;
    }
    message = match summary.has_limits() {
        true => limits(run, summary),
        false if summary.rows.len() == 1 => errors(run, summary),
        false if labels.reported_singly(summary, REPORTED) => one_by_one(run, summary, &labels),
        false => by_series(run, summary, &labels),
    };
    message.extend(objects::company(run, &name));
    message.extend(wrong(run, summary, &labels));
    message.extend(significance::sentences(run, comparisons, DIFFERENCES));
    message.extend(significance::others(comparisons, DIFFERENCES));
    message
}

/// A quantity with its name, its key and its distribution in a row.
type Metric = (&'static str, Field, fn(&Row) -> Option<Distribution>);

const METRICS: [Metric; 2] = [
    ("target registration error (TRE)", Field::Tre, |row| row.tre),
    ("camera position error", Field::Position, |row| row.position_error),
];

/// One sentence for every quantity, listing all trials.
///
/// They are in order of the numeric axis, or without one in order of decreasing fix rate.
fn one_by_one(run: &Run, summary: &RunSummary, labels: &Labels) -> Vec<Text> {
    let mut order: Vec<usize> = (0..summary.rows.len()).collect();
    if labels.along.is_none() {
        let fraction = |index: &usize| summary.rows[*index].found as f64 / summary.rows[*index].attempted.max(1) as f64;
        order.sort_by(|a, b| fraction(b).total_cmp(&fraction(a)));
    }
    let found = order.iter().map(|&index| {
        let (row, trial) = (&summary.rows[index], &run.trials[index]);
        let fraction = phrases::percent(trial, "found", row.found, row.attempted);
        let n = phrases::count(trial, "attempted", row.attempted);
        (fraction.value.is_some()).then(|| text![labels.of_trial(row), ": ", fraction, " % of ", n])
    });
    let mut message = vec![list("Fix rate (fixes in % of the attempts)", found)];
    let fit: Metric = ("fit RMS (the paper’s measure)", Field::Fit, |row| row.fit);
    for (name, field, of) in METRICS.into_iter().chain([fit]) {
        let digits = phrases::decimals(summary.rows.iter().map(|row| of(row).map(|s| s.median)), Unit::Millimetres);
        let medians = order.iter().map(|&index| {
            let (row, spread) = (&summary.rows[index], of(&summary.rows[index])?);
            let unit = (Unit::Millimetres, digits);
            let median = phrases::statistic(&run.trials[index], "median", field, "found", Some(spread.median), unit);
            Some(text![labels.of_trial(row), ": ", median, " mm"])
        });
        message.push(list(&format!("Median {name}"), medians));
    }
    message.retain(|text| text.len() > 2);
    message
}

/// A sentence of the form `name — a: 1; b: 2.`
fn list(name: &str, items: impl Iterator<Item = Option<Text>>) -> Text {
    let mut message = text![format!("{name} — ")];
    for (index, item) in items.flatten().enumerate() {
        if index > 0 {
            message.push("; ".into());
        }
        message.extend(item);
    }
    message.push(".".into());
    message
}

/// One sentence for every series: fixes, wrong fixes, and the errors along the axis.
fn by_series(run: &Run, summary: &RunSummary, labels: &Labels) -> Vec<Text> {
    let series = labels.series(summary).into_iter();
    series
        .map(|(name, members)| {
            let trials: Vec<&Trial> = members.iter().map(|&index| &run.trials[index]).collect();
            let total = |of: fn(&Row) -> usize| members.iter().map(|&index| of(&summary.rows[index])).sum::<usize>();
            let pooled = |group: &str, n: usize| {
                Number::count(n, phrases::over(&trials, "/metrics/evaluation", format!("count {group}")))
            };
            let (found, attempted) = (total(|row| row.found), total(|row| row.attempted));
            let key = phrases::over(&trials, "/metrics/evaluation", "percent found of attempted".to_owned());
            let fraction = (attempted > 0).then(|| 100.0 * found as f64 / attempted as f64);
            let mut message = text![
                format!("{name}: "),
                pooled("found", found),
                " fixes in ",
                pooled("attempted", attempted),
                " attempts (",
                Number::new(fraction, 1, key),
                " %), ",
                pooled("wrong", total(|row| row.wrong)),
                " wrong"
            ];
            message.extend(nowhere(summary, labels, &members).map(Span::from));
            for metric in METRICS {
                message.extend(course(run, summary, labels, &members, metric));
            }
            message.push(".".into());
            message
        })
        .collect()
}

/// The clause on values without a fix, like `, no fix at 4.5 and 5.5`; `None` for a series without any fix.
fn nowhere(summary: &RunSummary, labels: &Labels, members: &[usize]) -> Option<String> {
    let key = labels.along.as_ref()?;
    let found = |index: &usize| summary.rows[*index].found > 0;
    let places: Vec<String> =
        members.iter().filter(|index| !found(index)).map(|&index| labels.place(&summary.rows[index], key)).collect();
    (members.iter().any(found) && !places.is_empty()).then(|| format!(", no fix at {}", places.join(" and ")))
}

/// The clause on the median errors of a series, like `; the median TRE is a mm at 2 and b mm at 5`.
///
/// A run without a numeric axis has the smallest and the largest median instead.
fn course(run: &Run, summary: &RunSummary, labels: &Labels, members: &[usize], (name, field, of): Metric) -> Text {
    let known: Vec<(usize, f64)> =
        members.iter().filter_map(|&index| Some((index, of(&summary.rows[index])?.median))).collect();
    let digits = phrases::decimals(known.iter().map(|(_, median)| Some(*median)), Unit::Millimetres);
    let unit = (Unit::Millimetres, digits);
    let as_number = |(index, median): (usize, f64)| {
        phrases::statistic(&run.trials[index], "median", field, "found", Some(median), unit)
    };
    let mut ends = match &labels.along {
        Some(key) => {
            let place = |index: usize| value(&summary.rows[index], key).parse::<f64>().unwrap_or(0.0);
            let mut known = known;
            known.sort_by(|a, b| place(a.0).total_cmp(&place(b.0)));
            known
        }
        None => {
            let mut known = known;
            known.sort_by(|a, b| a.1.total_cmp(&b.1));
            known
        }
    };
    let (Some(last), Some(first)) = (ends.pop(), ends.first().copied()) else {
        return ends
            .pop()
            .map_or_else(Vec::new, |one| text![format!("; the median {name} is "), as_number(one), " mm"]);
    };
    match &labels.along {
        Some(key) => {
            let at = |index: usize| labels.place(&summary.rows[index], key);
            text![
                format!("; the median {name} is "),
                as_number(first),
                format!(" mm at {} and ", at(first.0)),
                as_number(last),
                format!(" mm at {}", at(last.0))
            ]
        }
        None => {
            text![format!("; the median {name} ranges from "), as_number(first), " to ", as_number(last), " mm"]
        }
    }
}

/// One sentence for every method: the smallest and the largest ratio of RMS error to Cramér–Rao bound.
fn limits(run: &Run, summary: &RunSummary) -> Vec<Text> {
    let methods = distinct(summary.rows.iter().map(Row::method)).into_iter();
    methods
        .filter_map(|method| {
            let own: Vec<usize> = (0..summary.rows.len())
                .filter(|&index| summary.rows[index].method() == method && summary.rows[index].limits.is_some())
                .collect();
            let trials: Vec<&Trial> = own.iter().map(|&index| &run.trials[index]).collect();
            let ratios = |which: fn(&Limits) -> [f64; 2]| -> Vec<f64> {
                let limits = own.iter().filter_map(|&index| summary.rows[index].limits);
                limits.map(|limits| which(&limits)).map(|[rms, bound]| rms / bound).collect()
            };
            let ends = |field: Field, ratios: &[f64]| {
                [("least", f64::min as fn(f64, f64) -> f64), ("greatest", f64::max)].map(|(which, pick)| {
                    let what = format!("{which} ratio {} of judged", field.name());
                    Number::new(ratios.iter().copied().reduce(pick), 3, phrases::over(&trials, "/metrics/totals", what))
                })
            };
            let [tre_low, tre_high] = ends(Field::Tre, &ratios(|limits| limits.tre));
            let [position_low, position_high] = ends(Field::Position, &ratios(|limits| limits.position));
            (!own.is_empty()).then(|| {
                text![
                    format!("{method}: the RMS target registration error (TRE) is "),
                    tre_low,
                    " to ",
                    tre_high,
                    " times its Cramér–Rao bound, the RMS camera position error ",
                    position_low,
                    " to ",
                    position_high,
                    " times its bound."
                ]
            })
        })
        .collect()
}

/// One sentence for every median of the only trial.
fn errors(run: &Run, summary: &RunSummary) -> Vec<Text> {
    let (trial, row) = (&run.trials[0], &summary.rows[0]);
    let as_number = METRICS.into_iter().filter_map(|(name, field, of)| {
        let median = of(row)?.median;
        let unit = (Unit::Millimetres, phrases::decimals([Some(median)].into_iter(), Unit::Millimetres));
        Some(text![
            format!("Median {name}: "),
            phrases::statistic(trial, "median", field, "found", Some(median), unit),
            " mm."
        ])
    });
    as_number.collect()
}

/// A sentence on the trial with the most wrong fixes.
///
/// The result is `None` without any, or for a single trial.
fn wrong(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let worst = (0..summary.rows.len()).rev().max_by_key(|&index| summary.rows[index].wrong)?;
    let (row, trial) = (&summary.rows[worst], &run.trials[worst]);
    if row.wrong == 0 || summary.rows.len() == 1 {
        return None;
    }
    let alike = summary.rows.iter().filter(|other| other.wrong == row.wrong).count();
    let began = if alike == 1 { "Most wrong fixes:" } else { "Most wrong fixes, shared by several trials:" };
    Some(text![
        format!("{began} {} with ", labels.of_trial(row)),
        phrases::count(trial, "wrong", row.wrong),
        " in ",
        phrases::count(trial, "attempted", row.attempted),
        " attempts."
    ])
}
