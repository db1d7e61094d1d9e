//! Whether covariances are honest, and what a search costs.

use super::{caption, distinct, figure, series};
use crate::{
    Field, Key, Number,
    document::{Figure, Head, Table, text},
    figure::{Axis, Chart, Entry, Layer, Panel},
    run::Run,
};

/// Width of a column of the histogram, and where it ends.
const STEP: f64 = 1.5;
const COLUMNS: usize = 16;

/// The normalised errors squared of all fixes found beside the density of χ² with six degrees of freedom.
pub(super) fn histogram(run: &Run) -> Option<Figure> {
    let trials: Vec<_> = run.trials.iter().collect();
    let all = || {
        run.trials
            .iter()
            .flat_map(|trial| trial.attempts())
            .filter(|(_, row)| row.found())
            .filter_map(|(_, row)| row.get(Field::Nees))
    };
    let n = all().count();
    if n < 20 {
        return None;
    }
    let mut counts = [0_usize; COLUMNS];
    all().for_each(|nees| counts[((nees / STEP) as usize).min(COLUMNS - 1)] += 1);
    let density = |x: f64| x * x * (-x / 2.0).exp() / 16.0;
    let heads = ["from", "to", "fixes", "density"].map(Head::numbers).to_vec();
    let mut data = Table::new("nees", text!["The columns of the histogram of NEES."], heads);
    let mut columns = Vec::new();
    for (index, &count) in counts.iter().enumerate() {
        let (from, to) = (index as f64 * STEP, (index + 1) as f64 * STEP);
        let height = count as f64 / n as f64 / STEP;
        columns.push([from, to, height]);
        let last = if index == COLUMNS - 1 { f64::INFINITY } else { to };
        let what = |name: &str| {
            crate::content::tell::over(
                &trials,
                "/metrics/evaluation",
                format!("{name} nees from {from} to {last} of found"),
            )
        };
        data.line(
            false,
            vec![
                from.to_string().into(),
                last.to_string().into(),
                Number::count(count, what("count")).into(),
                Number::new(Some(height), 4, what("density")).into(),
            ],
        );
    }
    let curve = (0..=160).map(|i| f64::from(i) * STEP * COLUMNS as f64 / 160.0).map(|x| [x, density(x)]).collect();
    let panel = Panel {
        x: Axis::linear("NEES").within([0.0, STEP * COLUMNS as f64]),
        y: Axis::linear("density"),
        layers: vec![Layer::Columns { series: 0, values: columns }, Layer::Line { series: 1, points: curve }],
        ..Panel::default()
    };
    let legend = vec![Entry::line("fixes found", 0), Entry::line("χ², six degrees of freedom", 1)];
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.66, legend };
    let said = format!(
        "Normalised error squared of {n} fixes found, of all trials: the curve is where an honest covariance puts it. The last column holds all beyond."
    );
    figure("nees", caption(&said, run), &chart, data)
}

/// The true error of the position over the one that its covariance promises: the diagram of Stanford's integrity
/// monitors. A mark right of the diagonal is an error beyond its bound.
pub(super) fn stanford(run: &Run) -> Option<Figure> {
    let names = distinct(run.trials.iter().map(|trial| trial.method().join(" + ")));
    if names.len() > 7 {
        return None;
    }
    let heads = [
        Head::words("series"),
        Head::numbers("frame"),
        Head::words("target"),
        Head::numbers("error (mm)"),
        Head::numbers("bound (mm)"),
    ];
    let mut data = Table::new("stanford", text!["Every mark of the diagram of integrity."], heads.to_vec());
    let mut marks = vec![Vec::new(); names.len()];
    let (mut n, mut beyond) = (0, 0);
    for trial in &run.trials {
        let index = series(&names, &trial.method().join(" + "));
        for (frame, row) in trial.attempts().filter(|(_, row)| row.outcome == seafix_log::Outcome::Referenced) {
            let (Some(error), Some(bound)) = (row.get(Field::Position), row.get(Field::PositionRadius)) else {
                continue;
            };
            n += 1;
            beyond += usize::from(error > bound);
            if n > 6000 {
                continue;
            }
            marks[index].push([error * 1e3, bound * 1e3]);
            let place = (trial.object(row), frame.number, frame.stamp_ns);
            let told = |field| {
                crate::content::tell::value(
                    trial,
                    place,
                    field,
                    row.get(field),
                    (crate::content::tell::Unit::Millimetres, 3),
                )
                .into()
            };
            let at = crate::content::tell::frame(trial, frame.number, frame.stamp_ns);
            data.line(
                false,
                vec![
                    names[index].clone().into(),
                    at.into(),
                    trial.object(row).to_owned().into(),
                    told(Field::Position),
                    told(Field::PositionRadius),
                ],
            );
        }
    }
    let values = || marks.iter().flatten().flatten().copied().filter(|v| *v > 0.0);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
    if n < 20 {
        return None;
    }
    let diagonal = Layer::Guide { points: vec![[low, low], [high, high]], note: "error = bound".to_owned(), dash: 1 };
    let layers = marks.into_iter().enumerate().map(|(series, points)| Layer::Marks { series, points, radius: 1.3 });
    let range = [low * 0.8, high * 1.25];
    let panel = Panel {
        x: Axis::logarithmic("error of the position (mm)").within(range),
        y: Axis::logarithmic("bound by its covariance (mm)").within(range),
        layers: layers.chain([diagonal]).collect(),
        ..Panel::default()
    };
    let legend = if names.len() > 1 {
        names.iter().enumerate().map(|(i, name)| Entry::mark(name.clone(), i)).collect()
    } else {
        Vec::new()
    };
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.95, legend };
    let key = crate::content::tell::over(
        &run.trials.iter().collect::<Vec<_>>(),
        "/metrics/evaluation",
        "beyond position_radius of referenced".to_owned(),
    );
    let mut said = text![
        "Integrity (Stanford diagram): the true error of the position over the radius that holds it with a chance of 99.99 % by the covariance of the fix, taken as a ball of its largest axis. "
    ];
    said.extend(text![Number::count(beyond, key), format!(" of {n} fixes lie beyond their bound, below the line. ")]);
    said.extend(caption("", run));
    figure("stanford", said, &chart, data)
}

/// Time of the search over how many candidates there were.
pub(in crate::content) fn search_cost(run: &Run) -> Option<Figure> {
    let names = distinct(run.trials.iter().map(|trial| trial.method()[0].clone()));
    if names.len() > 7 {
        return None;
    }
    let mut bins: Vec<Vec<(f64, Vec<f64>)>> = vec![Vec::new(); names.len()];
    for trial in &run.trials {
        let index = series(&names, &trial.method()[0]);
        for (_, row) in trial.attempts() {
            let (Some(size), Some(time)) = (row.get(Field::Candidates), row.get(Field::SearchTime)) else { continue };
            if size < 1.0 || time <= 0.0 {
                continue;
            }
            // Half octaves.
            let bin = (2.0 * size.log2()).round() / 2.0;
            match bins[index].iter_mut().find(|(known, _)| *known == bin) {
                Some((_, times)) => times.push(time),
                None => bins[index].push((bin, vec![time])),
            }
        }
    }
    let heads = [Head::words("search"), Head::numbers("candidates"), Head::numbers("n")];
    let heads = heads.into_iter().chain(["p5 (ms)", "median (ms)", "p95 (ms)"].map(Head::numbers));
    let mut data =
        Table::new("search-cost", text!["Every point of the figure of the cost of the search."], heads.collect());
    let mut layers = Vec::new();
    for (index, bins) in bins.iter_mut().enumerate() {
        bins.sort_by(|a, b| a.0.total_cmp(&b.0));
        let trials: Vec<_> = run.trials.iter().filter(|trial| trial.method()[0] == names[index]).collect();
        let (mut line, mut bars) = (Vec::new(), Vec::new());
        for (bin, times) in bins.iter_mut().filter(|(_, times)| times.len() >= 3) {
            let [low, middle, high] = [0.05, 0.5, 0.95].map(|p| seafix_evaluation::quantile(times, p));
            let size = 2_f64.powf(*bin);
            line.push([size, middle]);
            bars.push([size, low, high]);
            let told = |(what, value): (&str, f64)| {
                let what = format!("{what} search_ms at {bin} half octaves of candidates");
                Number::new(Some(value), 4, crate::content::tell::over(&trials, "/metrics/timing", what)).into()
            };
            let count = Key {
                what: format!("sampled search_ms at {bin} half octaves of candidates"),
                ..crate::content::tell::over(&trials, "/metrics/timing", String::new())
            };
            let mut cells = vec![
                names[index].clone().into(),
                format!("{size:.1}").into(),
                Number::count(times.len(), count).into(),
            ];
            cells.extend([("q5", low), ("median", middle), ("q95", high)].map(told));
            data.line(false, cells);
        }
        layers.push(Layer::Whiskers { series: index, values: bars });
        layers.push(Layer::Line { series: index, points: line.clone() });
        layers.push(Layer::Marks { series: index, points: line, radius: 2.0 });
    }
    let panel = Panel {
        x: Axis::logarithmic("candidates in all lists"),
        y: Axis::logarithmic("search (ms)"),
        layers,
        ..Panel::default()
    };
    let legend = names.iter().enumerate().map(|(index, name)| Entry::both(name.clone(), index)).collect();
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.7, legend };
    let said = "Time of the search over the size of its problem, the number of candidates: medians of half octaves with three attempts or more, bars from the 5 % to the 95 % quantile.";
    figure("search-cost", caption(said, run), &chart, data)
}
