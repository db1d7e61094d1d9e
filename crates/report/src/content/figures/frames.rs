//! The figure of the error of every fix over the frames.

use crate::{
    content::{
        figures::layout::{caption, figure, series},
        phrases::{self, Unit},
    },
    document::{Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::distinct,
    published::Published,
    run::Run,
    summary::RunSummary,
};

/// Maximum number of plotted fixes; more marks hide each other.
const MAX: usize = 4000;

/// The figure of fit RMS and TRE of every fix.
pub(crate) fn errors(run: &Run) -> Option<Figure> {
    let names = distinct(run.trials.iter().map(|trial| RunSummary::name(run, trial)));
    let fixes: usize = run.trials.iter().map(|trial| trial.attempts().count()).sum();
    if names.len() > 7 || fixes > MAX {
        return None;
    }
    let heads = [
        Head::words("series"),
        Head::numbers("frame"),
        Head::words("target"),
        Head::numbers("fit RMS (mm)"),
        Head::numbers("TRE (mm)"),
    ];
    let mut data =
        Table::new("error-over-frames", text!["The data of the figure of error over frames."], heads.to_vec());
    let metrics = [(Field::Fit, "fit RMS (mm)"), (Field::Tre, "TRE (mm)")];
    let mut points = vec![vec![Vec::new(); names.len()]; 2];
    // Marks of equal errors in one frame are placed side by side.
    let aside = |index: usize| 0.6 * ((index as f64 + 0.5) / names.len() as f64 - 0.5);
    for trial in &run.trials {
        let index = series(&names, &RunSummary::name(run, trial));
        for (frame, row) in trial.attempts() {
            let place = (trial.object(row), frame.number, frame.stamp_ns);
            let as_number = |field| phrases::value(trial, place, field, row.get(field), (Unit::Millimetres, 3));
            for (of, (field, _)) in metrics.iter().enumerate() {
                points[of][index]
                    .extend(row.get(*field).map(|value| [frame.number as f64 + aside(index), value * 1e3]));
            }
            let at = phrases::frame(trial, frame.number, frame.stamp_ns);
            let object = trial.object(row).to_owned();
            data.line(
                false,
                vec![
                    names[index].clone().into(),
                    at.into(),
                    object.into(),
                    as_number(Field::Fit).into(),
                    as_number(Field::Tre).into(),
                ],
            );
        }
    }
    let published = Published::of(run);
    let panels = metrics.into_iter().zip(points).map(|((field, label), points)| {
        let marks = points.into_iter().enumerate();
        let mut layers: Vec<Layer> =
            marks.map(|(series, points)| Layer::Marks { series, points, radius: 1.8 }).collect();
        layers.splice(0..0, Published::shaded(&published, field));
        Panel { x: Axis::linear("frame"), y: Axis::logarithmic(label), layers, ..Panel::default() }
    });
    let legend = if names.len() > 1 {
        names.iter().enumerate().map(|(i, name)| Entry::mark(name.clone(), i)).collect()
    } else {
        Vec::new()
    };
    let chart = Chart { panels: panels.collect(), columns: 2, page: true, shape: 0.7, legend };
    let message = format!(
        "Error of every fix over the frames; a frame without a mark has no fix.{}",
        Published::caption(&published, &metrics.map(|(field, _)| field))
    );
    figure("error-over-frames", caption(&message), &chart, data)
}
