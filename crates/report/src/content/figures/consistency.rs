//! Figures of the consistency of covariances: the NEES histogram and the coverage curve.

use crate::{
    content::{
        figures::layout::{caption, figure},
        phrases,
    },
    document::{Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::distinct,
    number::Number,
    proportion,
    run::{Run, Trial},
    summary::RunSummary,
};

/// The width of a column of the histogram, and the number of columns.
const STEP: f64 = 1.5;
const COLUMNS: usize = 16;

/// The histogram of the NEES of all fixes, with the density of χ² with six degrees of freedom.
pub(crate) fn histogram(run: &Run) -> Option<Figure> {
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
    let mut data = Table::new("nees", text!["The data of the NEES histogram."], heads);
    let mut columns = Vec::new();
    for (index, &count) in counts.iter().enumerate() {
        let (from, to) = (index as f64 * STEP, (index + 1) as f64 * STEP);
        let height = count as f64 / n as f64 / STEP;
        columns.push([from, to, height]);
        let last = if index == COLUMNS - 1 { f64::INFINITY } else { to };
        let what = |name: &str| {
            phrases::over(&trials, "/metrics/evaluation", format!("{name} nees from {from} to {last} of found"))
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
    let legend = vec![Entry::line("fixes", 0), Entry::line("χ², six degrees of freedom", 1)];
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.66, legend };
    let message = format!(
        "NEES (normalised estimation error squared) of the {n} fixes of all trials that are not wrong. The curve is the density for a consistent covariance. The last column holds all larger values."
    );
    figure("nees", caption(&message), &chart, data)
}

/// The confidence levels (%) at which coverage is counted.
const LEVELS: [f64; 14] = [5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 95.0, 98.0, 99.0, 99.9];
/// Minimum number of fixes of a series; fewer give no useful fraction.
const FEWEST: usize = 20;
/// Maximum number of lines; with more series all trials are merged into one.
const LINES: usize = 7;

/// The coverage curve: the fraction of fixes, wrong ones included, within their error bound at each confidence level.
///
/// It is on the diagonal for a consistent covariance, above it for one that is too large.
pub(crate) fn coverage(run: &Run) -> Option<Figure> {
    // A decimated log has all failures and few of the other frames.
    if run.trials.iter().any(|trial| trial.every() > 1) {
        return None;
    }
    let mut names = distinct(run.trials.iter().map(|trial| RunSummary::name(run, trial)));
    let apart = names.len() <= LINES;
    if !apart {
        names = vec!["all trials".to_owned()];
    }
    let heads = [Head::words("series"), Head::numbers("confidence (%)"), Head::numbers("NEES below")];
    let heads = heads.into_iter().chain(["fixes within (%)", "low (%)", "high (%)"].map(Head::numbers));
    let mut data = Table::new("coverage", text!["The data of the coverage curve."], heads.collect());
    let (mut bands, mut lines, mut n) = (Vec::new(), Vec::new(), 0);
    for (series, name) in names.iter().enumerate() {
        let own = |trial: &&Trial| !apart || RunSummary::name(run, trial) == *name;
        let trials: Vec<&Trial> = run.trials.iter().filter(own).collect();
        let rows = trials.iter().flat_map(|trial| trial.attempts()).filter(|(_, row)| row.found() || row.wrong());
        let nees: Vec<f64> = rows.filter_map(|(_, row)| row.get(Field::Nees)).collect();
        if nees.len() < FEWEST {
            continue;
        }
        n += nees.len();
        let trajectory = trials.iter().any(|trial| proportion::is_trajectory(&trial.header));
        let (mut line, mut band) = (Vec::new(), Vec::new());
        for level in LEVELS {
            // The rounded bound is part of the key, from which the number is computed again.
            let bound = (quantile(level / 100.0) * 1e4).round() / 1e4;
            let events: Vec<bool> = nees.iter().map(|nees| *nees <= bound).collect();
            let within = 100.0 * events.iter().filter(|event| **event).count() as f64 / events.len() as f64;
            let (low, high) = proportion::interval(trajectory, &events);
            let [low, high] = [low, high].map(|fraction| 100.0 * fraction);
            line.push([level, within]);
            band.push([level, low, high]);
            let as_number = |(what, value): (&str, f64)| {
                let what = format!("{what} nees<={bound} of fixes");
                Number::new(Some(value), 2, phrases::over(&trials, "/metrics/evaluation", what)).into()
            };
            let mut cells = vec![name.clone().into(), level.to_string().into(), bound.to_string().into()];
            cells.extend([("percent", within), ("low", low), ("high", high)].map(as_number));
            data.line(false, cells);
        }
        bands.push((series, band));
        lines.push(Layer::Line { series, points: line });
    }
    if lines.is_empty() {
        return None;
    }
    let banded = bands.len() <= 3;
    let band = |(series, values)| {
        if names.len() == 1 { Layer::Band { series, values } } else { Layer::Edges { series, values } }
    };
    let mut layers: Vec<Layer> = if banded { bands.into_iter().map(band).collect() } else { Vec::new() };
    layers.push(Layer::Rule { points: vec![[0.0, 0.0], [100.0, 100.0]], dash: 2 });
    layers.extend(lines);
    let panel = Panel {
        x: Axis::linear("confidence (%)").within([0.0, 100.0]),
        y: Axis::linear("fixes within (%)").within([0.0, 104.0]),
        layers,
        ..Panel::default()
    };
    let legend = names.iter().enumerate().map(|(index, name)| Entry::line(name.clone(), index));
    let legend = if names.len() > 1 { legend.collect() } else { Vec::new() };
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.8, legend };
    let called = proportion::called(run.trials.iter().map(|trial| &trial.header));
    let message = format!(
        "Coverage: the fraction of {n} fixes, wrong ones included, whose error is within the bound that their covariance gives for each confidence level{}. A consistent covariance is on the dashed diagonal; above it the covariance is too large, below it too small.",
        if banded {
            format!(", with {}", called.replace("intervals", "bands"))
        } else {
            format!("; the table has {called}")
        }
    );
    figure("coverage", caption(&message), &chart, data)
}

/// The quantile of χ² with six degrees of freedom, whose distribution function is 1 − e^(−x/2) (1 + x/2 + x²/8).
fn quantile(p: f64) -> f64 {
    let below = |x: f64| 1.0 - (-x / 2.0).exp() * (1.0 + x / 2.0 + x * x / 8.0);
    let (mut low, mut high) = (0.0, 100.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if below(middle) < p { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (p, x) in [(0.5, 5.3481), (0.9, 10.6446), (0.95, 12.5916), (0.99, 16.8119)] {
            assert!((super::quantile(p) - x).abs() < 1e-4, "{p}");
        }
    }
}
