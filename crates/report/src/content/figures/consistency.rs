//! Whether covariances are honest.

use super::{caption, figure};
use crate::{
    Field, Number,
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
