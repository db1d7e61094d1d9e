//! The answer to the question of an experiment: what was found along its axes, one sentence a quantity or a series.

use super::{
    figures, inspection, navigation, objects,
    phrases::{self, Unit},
    significance,
};
use crate::{
    Distribution, Field, Number, Row, RunSummary,
    document::{Span, Text, text},
    format,
    paired::Comparison,
    run::{Run, Trial},
};

/// So many trials are told one by one.
const REPORTED: usize = 9;
/// So many differences are told.
const DIFFERENCES: usize = 3;

/// The sentences.
pub(super) fn sentences(run: &Run, summary: &RunSummary, comparisons: &[Comparison]) -> Vec<Text> {
    let labels = Labels::of(summary);
    let name = |index: usize| labels.of_trial(&summary.rows[index]);
    let mut said = navigation::sentences(run, &name);
    said.extend(inspection::sentences(run, &name));
    said.extend(objects::sentences(run, &name));
    if !said.is_empty() {
        said.extend(wrong(run, summary, &labels));
        return said;
    }
    said = match super::limits::known(summary) {
        true => limits(run, summary),
        false if summary.rows.len() == 1 => errors(run, summary),
        false if labels.reported_singly(summary) => one_by_one(run, summary, &labels),
        false => by_series(run, summary, &labels),
    };
    said.extend(objects::company(run, &name));
    said.extend(wrong(run, summary, &labels));
    said.extend(significance::sentences(run, comparisons, DIFFERENCES));
    said
}

/// What trials and series of them are called.
struct Labels {
    /// The condition with numbers, along which a series goes.
    along: Option<String>,
    /// The axes that tell series apart.
    apart: Vec<String>,
}

impl Labels {
    fn of(summary: &RunSummary) -> Self {
        let along = figures::numeric(summary);
        let axes = summary.rows.first().map(|row| row.axes.clone()).unwrap_or_default();
        let varies = |key: &String| summary.rows.iter().any(|row| value(row, key) != value(&summary.rows[0], key));
        let apart = axes.into_iter().map(|axis| axis.key).filter(|key| Some(key) != along.as_ref() && varies(key));
        let mut apart: Vec<String> = apart.collect();
        // Methods on several kinds of problems: a series is a method.
        if along.is_none() && apart.len() > 1 {
            let method = |key: &String| matches!(format::short(key), "search" | "solver" | "method");
            if apart.iter().any(method) {
                apart.retain(method);
            }
        }
        Self { along, apart }
    }

    /// What a series is called that `row` belongs to.
    fn of_series(&self, row: &Row) -> String {
        let values: Vec<String> = self.apart.iter().map(|key| value(row, key)).collect();
        if values.is_empty() { row.method() } else { values.join(", ") }
    }

    /// What a trial is called among all.
    fn of_trial(&self, row: &Row) -> String {
        match (&self.along, self.apart.is_empty()) {
            (Some(key), true) => self.place(row, key),
            (Some(key), false) => format!("{}, {}", self.of_series(row), self.place(row, key)),
            (None, _) => {
                let values: Vec<String> = row.axes.iter().map(|axis| axis.value.clone()).collect();
                if values.is_empty() { row.method() } else { values.join(", ") }
            }
        }
    }

    fn place(&self, row: &Row, key: &str) -> String {
        format::placed(key, &value(row, key))
    }

    /// Whether each trial is worth a word: few, in one series or each a series of its own.
    fn reported_singly(&self, summary: &RunSummary) -> bool {
        let series = self.series(summary).len();
        summary.rows.len() <= REPORTED && (series == 1 || series == summary.rows.len())
    }

    /// The rows of each series, in the order of the run.
    fn series(&self, summary: &RunSummary) -> Vec<(String, Vec<usize>)> {
        let mut series: Vec<(String, Vec<usize>)> = Vec::new();
        for (index, row) in summary.rows.iter().enumerate() {
            let name = self.of_series(row);
            match series.iter_mut().find(|(known, _)| *known == name) {
                Some((_, members)) => members.push(index),
                None => series.push((name, vec![index])),
            }
        }
        series
    }
}

fn value(row: &Row, key: &str) -> String {
    row.axes.iter().find(|axis| axis.key == key).map_or_else(String::new, |axis| axis.value.clone())
}

/// A quantity whose medians are told.
type Metric = (&'static str, Field, fn(&Row) -> Option<Distribution>);

const METRICS: [Metric; 2] = [
    ("error of the model points (TRE)", Field::Tre, |row| row.tre),
    ("error of the camera’s position", Field::Position, |row| row.position_error),
];

/// One sentence a quantity, every trial in it: along the condition, or most first.
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
    let mut said = vec![list("Found of the attempts", found)];
    let fit: Metric = ("residual of the identified points", Field::Fit, |row| row.fit);
    for (name, field, of) in METRICS.into_iter().chain([fit]) {
        let digits = phrases::decimals(summary.rows.iter().map(|row| of(row).map(|s| s.median)), Unit::Millimetres);
        let medians = order.iter().map(|&index| {
            let (row, spread) = (&summary.rows[index], of(&summary.rows[index])?);
            let unit = (Unit::Millimetres, digits);
            let median = phrases::statistic(&run.trials[index], "median", field, "found", Some(spread.median), unit);
            Some(text![labels.of_trial(row), ": ", median, " mm"])
        });
        said.push(list(&format!("Median {name}"), medians));
    }
    said.retain(|text| text.len() > 2);
    said
}

/// `name — a: 1; b: 2.`
fn list(name: &str, items: impl Iterator<Item = Option<Text>>) -> Text {
    let mut said = text![format!("{name} — ")];
    for (index, item) in items.flatten().enumerate() {
        if index > 0 {
            said.push("; ".into());
        }
        said.extend(item);
    }
    said.push(".".into());
    said
}

/// One sentence a series: how many it found, and how its errors go.
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
            let mut said = text![
                format!("{name}: "),
                pooled("found", found),
                " of ",
                pooled("attempted", attempted),
                " found (",
                Number::new(fraction, 1, key),
                " %), ",
                pooled("wrong", total(|row| row.wrong)),
                " wrong"
            ];
            said.extend(nowhere(summary, labels, &members).map(Span::from));
            for metric in METRICS {
                said.extend(course(run, summary, labels, &members, metric));
            }
            said.push(".".into());
            said
        })
        .collect()
}

/// `, none at 4.5 and 5.5`: where along the condition a series that finds something finds nothing.
fn nowhere(summary: &RunSummary, labels: &Labels, members: &[usize]) -> Option<String> {
    let key = labels.along.as_ref()?;
    let found = |index: &usize| summary.rows[*index].found > 0;
    let places: Vec<String> =
        members.iter().filter(|index| !found(index)).map(|&index| labels.place(&summary.rows[index], key)).collect();
    (members.iter().any(found) && !places.is_empty()).then(|| format!(", none at {}", places.join(" and ")))
}

/// `; the median error … goes from a mm at 2 to b mm at 5`, or between the least and the greatest.
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
                format!("; the median {name} goes from "),
                as_number(first),
                format!(" mm at {} to ", at(first.0)),
                as_number(last),
                format!(" mm at {}", at(last.0))
            ]
        }
        None => {
            text![format!("; the median {name} lies between "), as_number(first), " and ", as_number(last), " mm"]
        }
    }
}

/// Root mean squares beside their bounds, the closest and the farthest.
fn limits(run: &Run, summary: &RunSummary) -> Vec<Text> {
    let methods = super::distinct(summary.rows.iter().map(Row::method)).into_iter();
    methods
        .filter_map(|method| {
            let own: Vec<usize> = (0..summary.rows.len())
                .filter(|&index| summary.rows[index].method() == method && summary.rows[index].limits.is_some())
                .collect();
            let trials: Vec<&Trial> = own.iter().map(|&index| &run.trials[index]).collect();
            let ratios = |which: fn(&crate::Limits) -> [f64; 2]| -> Vec<f64> {
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
                    format!("{method}: the root mean square error of the model points is "),
                    tre_low,
                    " to ",
                    tre_high,
                    " times the Cramér–Rao bound, that of the camera’s position ",
                    position_low,
                    " to ",
                    position_high,
                    " times."
                ]
            })
        })
        .collect()
}

/// The medians of the only trial.
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

/// How many fixes were wrong, and where most of them were.
fn wrong(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let worst = (0..summary.rows.len()).rev().max_by_key(|&index| summary.rows[index].wrong)?;
    let (row, trial) = (&summary.rows[worst], &run.trials[worst]);
    if row.wrong == 0 || summary.rows.len() == 1 {
        return None;
    }
    let alike = summary.rows.iter().filter(|other| other.wrong == row.wrong).count();
    let began = if alike == 1 { "Most wrong fixes were made with" } else { "No trial has more wrong fixes than" };
    Some(text![
        format!("{began} {}: ", labels.of_trial(row)),
        phrases::count(trial, "wrong", row.wrong),
        " of ",
        phrases::count(trial, "attempted", row.attempted),
        " attempts."
    ])
}
