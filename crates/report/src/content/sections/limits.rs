//! RMS errors and the Cramér–Rao bound, for trials in which every fix has a bound.

use crate::{
    content::{
        conditions::columns,
        figures::layout::same_axes,
        phrases::{self, Unit},
    },
    document::{Block, Cell, Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::{distinct, headed, short, unit},
    number::{Key, Number},
    run::{Run, Trial},
    summary::{Limits, Row, RunSummary},
};

pub(crate) fn blocks(run: &Run, summary: &RunSummary) -> Vec<Block> {
    over_noise(run, summary).into_iter().map(Block::Figure).chain([Block::Table(table(run, summary))]).collect()
}

/// A number from the totals of a trial.
fn total(trial: &Trial, what: &str, value: f64, unit: Unit, decimals: usize) -> Number {
    let suffix = if unit == Unit::Millimetres { " in mm" } else { "" };
    let key = Key::of(trial, "/metrics/totals", format!("{what}{suffix}"));
    Number::new(Some(value * unit.scale()), decimals, key)
}

fn value(row: &Row, key: &str) -> Option<String> {
    row.axes.iter().find(|axis| axis.key == key).map(|axis| axis.value.clone())
}

/// The figure of RMS TRE over pixel noise, with one panel for every combination of the other conditions.
fn over_noise(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let on = |key: &str| distinct(summary.rows.iter().filter_map(|row| value(row, key)));
    let axes = summary.rows.first()?.axes.iter();
    let key = axes.map(|axis| axis.key.clone()).find(|key| unit(key) == Some("px") && on(key).len() > 1)?;
    let conditions = |row: &Row| -> String {
        let others = row.conditions().filter(|axis| axis.key != key);
        let words = others.map(|axis| match (axis.value.parse::<f64>(), unit(&axis.key)) {
            (Ok(_), Some(unit)) => format!("{} {unit}", axis.value),
            (Ok(_), None) => format!("{} {}", axis.value, short(&axis.key)),
            _ => axis.value.clone(),
        });
        words.collect::<Vec<_>>().join(", ")
    };
    let with_limits = || summary.rows.iter().enumerate().filter(|(_, row)| row.limits.is_some());
    let places = distinct(with_limits().map(|(_, row)| conditions(row)));
    let methods = distinct(summary.rows.iter().map(|row| row.solver.clone()));
    let bound = 6; // the dark grey of the palette
    let ticks: Vec<f64> = on(&key).iter().filter_map(|value| value.parse().ok()).collect();
    let heads =
        [Head::words("condition"), Head::words("series"), Head::numbers(headed(&key)), Head::numbers("RMS TRE (mm)")];
    let mut data = Table::new("error-over-noise", text!["The data of the figure of error over noise."], heads.to_vec());
    let mut panels = Vec::new();
    for place in &places {
        let mut layers = Vec::new();
        for (series, method) in methods.iter().map(String::as_str).chain(["Cramér–Rao bound"]).enumerate() {
            let is_bound = series == methods.len();
            let rows = with_limits().filter(|(_, row)| conditions(row) == *place && (is_bound || row.solver == method));
            let mut points: Vec<([f64; 2], usize)> = rows
                .filter_map(|(index, row)| {
                    let tre = row.limits?.tre[usize::from(is_bound)] * 1e3;
                    Some(([value(row, &key)?.parse().ok()?, tre], index))
                })
                .collect();
            points.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
            points.dedup_by(|a, b| is_bound && a.0[0] == b.0[0]);
            for ([x, tre], index) in &points {
                let what = if is_bound { "bound tre_crlb of judged" } else { "rms tre_rms of judged" };
                let number = total(&run.trials[*index], what, tre / 1e3, Unit::Millimetres, 4);
                let noise = phrases::axis(&run.trials[*index], &key, Some(*x));
                data.line(false, vec![place.clone().into(), method.into(), noise.into(), number.into()]);
            }
            let points: Vec<[f64; 2]> = points.into_iter().map(|(point, _)| point).collect();
            let index = if is_bound { bound } else { series };
            layers.push(Layer::Line { series: index, points: points.clone() });
            if !is_bound {
                layers.push(Layer::Marks { series: index, points, radius: 1.5 });
            }
        }
        panels.push(Panel {
            title: place.clone(),
            x: Axis::logarithmic("").at(ticks.clone()),
            y: Axis::logarithmic(""),
            layers,
            equal: false,
        });
    }
    same_axes(&mut panels);
    let entries = methods.iter().enumerate().map(|(series, name)| Entry::both(name.clone(), series));
    let columns = columns(&places);
    let rows = panels.len().div_ceil(columns);
    for (index, panel) in panels.iter_mut().enumerate() {
        if index % columns == 0 {
            panel.y.label = "RMS TRE (mm)".to_owned();
        }
        if index / columns == rows - 1 {
            panel.x.label = headed(&key);
        }
    }
    let chart = Chart {
        panels,
        columns,
        page: true,
        shape: 0.95,
        legend: entries.chain([Entry::line("Cramér–Rao bound", bound)]).collect(),
    };
    Some(Figure {
        id: "error-over-noise".to_owned(),
        caption: text![
            "RMS target registration error (TRE) over the pixel noise, for all fixes of a trial including wrong ones. Both axes are logarithmic and shared by all panels. Grey: the Cramér–Rao bound, below which no unbiased estimator can be."
        ],
        drawing: chart.draw()?,
        data,
    })
}

/// The number of panels in a row: one to six, so that the longest title fits.
fn columns(titles: &[String]) -> usize {
    /// The number of characters across the page, with a gap of two between titles.
    const ACROSS: usize = 120;
    let longest = titles.iter().map(|title| title.chars().count()).max().unwrap_or(0);
    (ACROSS / (longest + 2)).clamp(1, 6).min(titles.len().max(1))
}

fn table(run: &Run, summary: &RunSummary) -> Table {
    let caption = text![
        "RMS errors (RMSE), Cramér–Rao bounds and their ratios, over all n fixes including wrong ones. NEES: mean normalised estimation error squared, 6 for a consistent covariance; below 95 %: fraction of the fixes below the 95 % quantile of χ² with six degrees of freedom."
    ];
    let mut above = columns::blank(summary, 1);
    above.extend([Head::over(3, "TRE (mm)"), Head::over(3, "position error (mm)"), Head::words(""), Head::words("")]);
    let mut below = columns::heads(summary);
    below.push(Head::numbers("n"));
    below.extend((0..2).flat_map(|_| ["RMSE", "bound", "ratio"].map(Head::numbers)));
    below.extend(["NEES", "below 95 %"].map(Head::numbers));
    let limits = |which: fn(&Limits) -> f64| summary.rows.iter().map(move |row| row.limits.map(|l| which(&l)));
    let digits = [limits(|l| l.tre[1]), limits(|l| l.position[1])].map(|of| phrases::decimals(of, Unit::Millimetres));
    let mut table = Table { id: "limits".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let Some(limits) = row.limits else { continue };
        let mut line = columns::cells(row);
        line.push(Number::count(limits.count as usize, Key::of(trial, "/metrics/totals", "count judged")).into());
        let pairs =
            [(Field::Tre, Field::TreCrlb, limits.tre), (Field::Position, Field::PositionBound, limits.position)];
        for ((field, bounded, [rmse, bound]), digits) in pairs.into_iter().zip(digits) {
            let message = |what: String, value, digits| total(trial, &what, value, Unit::Millimetres, digits);
            line.push(message(format!("rms {} of judged", field.name()), rmse, digits).into());
            line.push(Cell::minor(message(format!("bound {} of judged", bounded.name()), bound, digits)));
            line.push(total(trial, &format!("ratio {} of judged", field.name()), rmse / bound, Unit::Plain, 3).into());
        }
        line.push(total(trial, "mean nees of judged", limits.nees, Unit::Plain, 3).into());
        line.push(total(trial, "within nees of judged", limits.coverage, Unit::Plain, 4).into());
        table.line(columns::breaks(summary, index), line);
    }
    table
}
