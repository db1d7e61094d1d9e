//! The figure of recall: the fraction of attempts with an error below a bound.

use crate::{
    content::figures::layout::{self, caption, panels, same_axes, series},
    document::{Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::distinct,
    number::{Key, Number},
    proportion,
    run::Run,
};

/// Maximum number of lines with bands that remain distinguishable.
const BANDS: usize = 3;

/// The figure of recall over the TRE with 95 % bands.
///
/// Rejected attempts and wrong fixes are below no bound.
pub(crate) fn figure(run: &Run) -> Option<Figure> {
    let mut groups = panels(run, 6);
    // Many bands in one panel hide each other.
    if let [(_, members)] = &groups[..]
        && members.len() > BANDS
    {
        groups = members.iter().map(|member| (member.0.clone(), vec![member.clone()])).collect();
    }
    let names = distinct(groups.iter().flat_map(|(_, members)| members.iter().map(|(name, _)| name.clone())));
    if names.len() > 7 {
        return None;
    }
    let heads = [Head::words("condition"), Head::words("series"), Head::numbers("TRE below (mm)")];
    let heads = heads.into_iter().chain(["recall (%)", "low (%)", "high (%)"].map(Head::numbers));
    let mut data = Table::new("recall", text!["The data of the figure of recall."], heads.collect());
    let mut plotted = Vec::new();
    for (condition, members) in &groups {
        let (mut bands, mut lines) = (Vec::new(), Vec::new());
        for (name, trial) in members {
            let errors: Vec<f64> = trial.attempts().map(|(_, row)| row.error_or_failure(Field::Tre)).collect();
            let n = errors.len();
            if errors.iter().all(|error| error.is_infinite()) {
                continue;
            }
            let trajectory = proportion::is_trajectory(&trial.header);
            let (mut line, mut band) = (Vec::new(), Vec::new());
            for ((threshold, bound), (low, high)) in proportion::bounds().zip(proportion::band(trajectory, &errors)) {
                let k = errors.iter().filter(|error| **error <= bound).count();
                // A single rounding: dividing and multiplying in another order could change the last printed digit.
                let fraction = 100.0 * k as f64 / n as f64;
                let [low, high] = [low, high].map(|fraction| 100.0 * fraction);
                line.push([threshold, fraction]);
                band.push([threshold, low, high]);
                let as_number = |(what, value): (&str, f64)| {
                    let what = format!("{what} tre_rms<={threshold} of attempted in mm");
                    Number::new(Some(value), 2, Key::of(trial, "/metrics/evaluation", what)).into()
                };
                let mut cells = vec![condition.clone().into(), name.clone().into(), threshold.to_string().into()];
                cells.extend([("percent", fraction), ("low", low), ("high", high)].map(as_number));
                data.line(false, cells);
            }
            // Several filled bands would hide each other.
            let series = series(&names, name);
            bands.push(match members.len() {
                1 => Layer::Band { series, values: band },
                _ => Layer::Edges { series, values: band },
            });
            lines.push(Layer::Line { series, points: line });
        }
        bands.extend(lines);
        plotted.push(Panel {
            title: condition.clone(),
            x: Axis::logarithmic("TRE below (mm)").at(vec![1.0, 2.0, 5.0, 10.0, 20.0, 50.0]),
            y: Axis::linear("recall (%)").within([0.0, 104.0]),
            layers: bands,
            equal: false,
        });
    }
    same_axes(&mut plotted);
    let columns = plotted.len().clamp(1, 3).min(if plotted.len() == 4 { 2 } else { 3 });
    let page = plotted.len() > 1;
    let legend = names.iter().enumerate().map(|(index, name)| Entry::line(name.clone(), index)).collect();
    let chart = Chart { panels: plotted, columns, page, shape: if columns == 2 { 0.6 } else { 0.75 }, legend };
    let bands = proportion::called(run.trials.iter().map(|trial| &trial.header)).replace("intervals", "bands");
    let message = format!(
        "Recall: the fraction of all attempts whose TRE is below a bound, with {bands}. Rejected attempts and wrong fixes are below no bound."
    );
    layout::figure("recall", caption(&message), &chart, data)
}
