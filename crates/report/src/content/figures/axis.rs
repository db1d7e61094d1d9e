//! Figures of errors over a numeric condition.

use crate::{
    content::{
        conditions::axes::{keys, name, numeric, on},
        figures::layout::{caption, figure, panels, series},
        phrases::{self, Unit},
    },
    document::{Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::{distinct, headed, sentence_case, short},
    number::{Key, Number},
    published::Published,
    run::{Run, Trial},
    summary::{Distribution, Row, RunSummary},
};

/// A quantity with its distribution in a row and its axis label.
type Metric = (Field, fn(&Row) -> Option<Distribution>, &'static str);

/// The figure of two errors over the condition, with published ranges.
///
/// Over distance it also shows growth with z and z².
pub(crate) fn errors(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let key = numeric(summary)?;
    let names = distinct(summary.rows.iter().map(|row| name(row, &key)));
    if names.len() > 14 {
        return None;
    }
    let mut ticks: Vec<f64> = summary.rows.iter().filter_map(|row| on(row, &key)).collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    let (&first, &last) = (ticks.first()?, ticks.last()?);
    // Values over more than a decade would overlap at one end of a linear axis.
    let wide = first > 0.0 && last / first > 12.0;
    let reach = if wide { (last / first).ln() } else { last - first };
    let mut heads = vec![Head::words("series"), Head::numbers(headed(&key)), Head::words("metric")];
    heads.extend(["p5 (mm)", "median (mm)", "p95 (mm)"].map(Head::numbers));
    let mut data =
        Table::new("error-over-condition", text!["The data of the figure of error over the condition."], heads);
    let published = Published::of(run);
    let metrics = metrics(summary, &published);
    let mut plotted = Vec::new();
    for (field, value, label) in metrics {
        let mut layers = Vec::new();
        let (mut lines, mut all) = (Vec::new(), Vec::new());
        for (index, series_name) in names.iter().enumerate() {
            let mut points: Vec<(f64, Distribution, &Trial)> = Vec::new();
            for (row, trial) in summary.rows.iter().zip(&run.trials).filter(|(row, _)| name(row, &key) == *series_name)
            {
                points.extend(value(row).zip(on(row, &key)).map(|(spread, x)| (x, spread, trial)));
            }
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (x, spread, trial) in &points {
                let as_number = |name: &str, value| {
                    phrases::statistic(trial, name, field, "found", Some(value), (Unit::Millimetres, 3)).into()
                };
                let place = phrases::axis(trial, &key, Some(*x));
                let ends =
                    [as_number("q5", spread.p5), as_number("median", spread.median), as_number("q95", spread.p95)];
                data.line(
                    false,
                    [series_name.clone().into(), place.into(), field.name().into()].into_iter().chain(ends).collect(),
                );
            }
            // Series with the same abscissa are shifted apart.
            let shift = 0.012 * reach * (index as f64 - (names.len() as f64 - 1.0) / 2.0);
            let at = |x: f64| if wide { x * shift.exp() } else { x + shift };
            let line: Vec<[f64; 2]> = points.iter().map(|(x, s, _)| [at(*x), s.median * 1e3]).collect();
            all.extend(line.iter().copied());
            layers.push(Layer::Whiskers {
                series: index,
                values: points.iter().map(|(x, s, _)| [at(*x), s.p5 * 1e3, s.p95 * 1e3]).collect(),
            });
            layers.push(Layer::Line { series: index, points: line.clone() });
            lines.push(Layer::Marks { series: index, points: line, radius: 2.2 });
        }
        layers.extend(lines);
        if ranges(&key) {
            layers.splice(0..0, laws(&ticks, &all));
        }
        layers.splice(0..0, Published::shaded(&published, field));
        let x = Axis { logarithmic: wide, ..Axis::linear(headed(&key)) }.at(ticks.clone());
        let y = Axis::logarithmic(label);
        plotted.push(Panel { title: String::new(), x, y, layers, equal: false });
    }
    let legend = names.iter().enumerate().map(|(index, name)| Entry::both(name.clone(), index)).collect();
    let chart = Chart { panels: plotted, columns: 2, page: true, shape: 0.78, legend };
    let laws = if ranges(&key) { " Thin grey lines: growth with the distance z and with its square." } else { "" };
    let message = format!(
        "{} and {} over {}: medians of the fixes, with bars from the 5 % to the 95 % quantile, slightly shifted apart.{laws}{}",
        sentence_case(metrics[0].2.trim_end_matches(" (mm)")),
        metrics[1].2.trim_end_matches(" (mm)"),
        short(&key),
        Published::caption(&published, &metrics.map(|(field, ..)| field))
    );
    figure("error-over-condition", caption(&message), &chart, data)
}

/// The two quantities of the figure: the error that the first page states, and the fit RMS where a publication states one.
fn metrics(summary: &RunSummary, published: &[Published]) -> [Metric; 2] {
    let position: Metric = (Field::Position, |row| row.position_error, "camera position error (mm)");
    let tre: Metric = (Field::Tre, |row| row.tre, "TRE (mm)");
    let fit: Metric = (Field::Fit, |row| row.fit, "fit RMS (mm)");
    let stated = !Published::caption(published, &[Field::Fit]).is_empty();
    match (summary.rows.iter().any(|row| row.position_error.is_some()), stated) {
        (true, true) => [position, fit],
        (true, false) => [position, tre],
        (false, _) => [tre, fit],
    }
}

/// Whether a condition is the distance to the objects, or nearly so.
fn ranges(key: &str) -> bool {
    matches!(short(key), "distance" | "altitude")
}

/// The laws z and z² through the median of the values at the smallest distance.
fn laws(ticks: &[f64], all: &[[f64; 2]]) -> Vec<Layer> {
    let (Some(&first), Some(&last)) = (ticks.first(), ticks.last()) else { return Vec::new() };
    let mut near: Vec<f64> = all.iter().filter(|p| (p[0] - first).abs() < 0.1 * (last - first)).map(|p| p[1]).collect();
    if near.is_empty() || !(first > 0.0) {
        return Vec::new();
    }
    let middle = seafix_evaluation::median(&mut near);
    let steps = || (0..=24).map(|i| first + (last - first) * f64::from(i) / 24.0);
    [(1, "∝ z", 4), (2, "∝ z²", 2)]
        .map(|(power, note, dash)| Layer::Guide {
            points: steps().map(|z| [z, middle * (z / first).powi(power)]).collect(),
            note: note.replace('∝', "~"),
            dash,
        })
        .into()
}

/// A quantity with its unit and its axis label.
type Distributed = (Field, Unit, &'static str);

/// The figure of error distributions, with one box for every trial.
///
/// It shows the TRE; over a fraction of outliers it shows attitude error, position error and search time, as the
/// literature on robust registration does.
pub(crate) fn boxes(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let groups = panels(run, 12);
    let names = distinct(groups.iter().flat_map(|(_, members)| members.iter().map(|(name, _)| name.clone())));
    if names.len() > 7 || run.trials.len() < 2 {
        return None;
    }
    let over_outliers = keys(summary).iter().any(|key| short(key) == "outliers");
    let shown: &[Distributed] = if over_outliers {
        &[
            (Field::Attitude, Unit::Degrees, "attitude error (deg)"),
            (Field::Position, Unit::Millimetres, "position error (mm)"),
            (Field::SearchTime, Unit::Plain, "search (ms)"),
        ]
    } else {
        &[(Field::Tre, Unit::Millimetres, "TRE (mm)")]
    };
    let heads = [Head::words("condition"), Head::words("series"), Head::words("metric")].into_iter();
    let heads = heads.chain(["n", "p5", "p25", "median", "p75", "p95"].map(Head::numbers));
    let mut data = Table::new("distribution", text!["The data of the figure of distributions."], heads.collect());
    let conditions: Vec<String> = groups.iter().map(|(condition, _)| condition.clone()).collect();
    let mut plotted = Vec::new();
    let mut any_single = false;
    for &(field, unit, label) in shown {
        let mut single = Vec::new();
        let mut layers: Vec<Layer> =
            (0..names.len()).map(|series| Layer::Boxes { series, values: Vec::new() }).collect();
        for (place, (condition, members)) in groups.iter().enumerate() {
            for (name, trial) in members {
                let found = trial.attempts().filter(|(_, row)| row.found()).filter_map(|(_, row)| row.get(field));
                let mut values: Vec<f64> = found.collect();
                if values.is_empty() {
                    continue;
                }
                let width = 0.8 / names.len() as f64;
                let index = series(&names, name);
                let x = place as f64 + width * (index as f64 - (names.len() as f64 - 1.0) / 2.0);
                let scaled: Vec<f64> = values.iter().map(|value| value * unit.scale()).collect();
                single.extend((values.len() < FEW).then(|| points(index, (x, 0.3 * width), &scaled)));
                let quantiles = [0.05, 0.25, 0.5, 0.75, 0.95].map(|p| seafix_evaluation::quantile(&mut values, p));
                if let Layer::Boxes { values, .. } = &mut layers[index] {
                    values.push(([x, 0.36 * width], quantiles.map(|q| q * unit.scale())));
                }
                let as_number = |(what, value): (&str, f64)| {
                    phrases::statistic(trial, what, field, "found", Some(value), (unit, 3)).into()
                };
                let mut line = vec![condition.clone().into(), name.clone().into(), label.into()];
                line.push(n(trial, field, values.len()).into());
                line.extend(["q5", "q25", "median", "q75", "q95"].into_iter().zip(quantiles).map(as_number));
                data.line(false, line);
            }
        }
        any_single |= !single.is_empty();
        layers.extend(single);
        // A run without durations has no panel of times.
        if layers.iter().any(|layer| matches!(layer, Layer::Boxes { values, .. } if !values.is_empty())) {
            let (x, y) = (Axis::named("", conditions.clone()), Axis::logarithmic(label));
            plotted.push(Panel { x, y, layers, ..Panel::default() });
        }
    }
    let legend = names.iter().enumerate().map(|(index, name)| Entry::line(name.clone(), index)).collect();
    let page = groups.len() * names.len() > 6;
    let chart = Chart { panels: plotted, columns: 1, page, shape: if page { 0.42 } else { 0.72 }, legend };
    let mut message = "Distribution over the fixes: boxes from the 25 % to the 75 % quantile with the median, whiskers to the 5 % and 95 % quantiles.".to_owned();
    if any_single {
        message += &format!(" Points: the single fixes of trials with fewer than {FEW}.");
    }
    figure("distribution", caption(&message), &chart, data)
}

/// Number of values below which a box hides how few they are, and each is drawn.
const FEW: usize = 30;

/// The single values at an abscissa, spread over a half width in their order, so that equal ones remain visible.
fn points(series: usize, (x, half): (f64, f64), values: &[f64]) -> Layer {
    let n = values.len() as f64;
    let at = |place: usize| x + half * (2.0 * (place as f64 + 0.5) / n - 1.0);
    let points = values.iter().enumerate().map(|(place, value)| [at(place), *value]).collect();
    Layer::Marks { series, points, radius: 1.1 }
}

/// The number of fixes in the sample.
fn n(trial: &Trial, field: Field, n: usize) -> Number {
    let key = Key::of(trial, field.topic(), format!("sampled {} of found", field.name()));
    Number::count(n, key)
}
