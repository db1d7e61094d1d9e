//! The figure of error growth between fixes, with and without further fixes.

use crate::{
    content::{
        figures::layout::{caption, figure as finish},
        phrases::{self, Unit},
    },
    document::{Figure, Head, Table, text},
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::condition,
    navigation_quantity::{Counted, NavigationQuantity},
    run::{Run, Trial},
};

/// Maximum number of trials, one panel each.
const PANELS: usize = 4;

/// The figure of the camera position error over time, navigated and by odometry only.
///
/// Odometry starts at the first fix. Every fix has a mark; gaps are times without a pose.
pub(crate) fn figure(run: &Run) -> Option<Figure> {
    let trials: Vec<&Trial> =
        run.trials.iter().filter(|trial| trial.sample().any(|frame| frame.navigated.is_some())).take(PANELS).collect();
    let heads = [
        Head::words("trial"),
        Head::numbers("frame"),
        Head::numbers("navigated position error (mm)"),
        Head::numbers("odometry-only position error (mm)"),
        Head::words("fix"),
    ];
    let mut data = Table::new("sawtooth", text!["The data of the figure of error growth between fixes."], heads.into());
    let mut panels = Vec::new();
    for trial in trials {
        let start = trial.span()[0];
        let (mut runs, mut alone, mut fixes) = (vec![Vec::new()], vec![Vec::new()], Vec::new());
        for frame in trial.sample() {
            let Some(navigated) = &frame.navigated else { continue };
            let seconds = (frame.stamp_ns - start) as f64 * 1e-9;
            let value = |quantity| navigated.get(quantity).map(|metres| [seconds, metres * 1e3]);
            for (quantity, lines) in
                [(NavigationQuantity::Position, &mut runs), (NavigationQuantity::AlonePosition, &mut alone)]
            {
                match (value(quantity), lines.last_mut()) {
                    (Some(point), Some(line)) => line.push(point),
                    (None, Some(line)) if !line.is_empty() => lines.push(Vec::new()),
                    _ => {}
                }
            }
            let fixed = navigated.is(Counted::Fix);
            fixes.extend(value(NavigationQuantity::Position).filter(|_| fixed));
            let as_number = |quantity| {
                let place = (frame.number, frame.stamp_ns);
                phrases::navigated_at(trial, place, quantity, navigated.get(quantity), (Unit::Millimetres, 3)).into()
            };
            data.line(
                false,
                vec![
                    trial.header.trial.clone().into(),
                    phrases::frame(trial, frame.number, frame.stamp_ns).into(),
                    as_number(NavigationQuantity::Position),
                    as_number(NavigationQuantity::AlonePosition),
                    (if fixed { "yes" } else { "" }).into(),
                ],
            );
        }
        let lines = |lines: Vec<Vec<[f64; 2]>>, series: usize| {
            lines.into_iter().filter(|line| line.len() > 1).map(move |points| Layer::Line { series, points })
        };
        let few = fixes.len() * 4 < trial.count();
        let mut layers: Vec<Layer> = lines(alone, 1).chain(lines(runs, 0)).collect();
        // Marks would hide the line if nearly every frame had a fix.
        layers.extend(few.then_some(Layer::Marks { series: 2, points: fixes, radius: 1.8 }));
        panels.push(Panel {
            title: trial.header.axes.iter().map(condition).collect::<Vec<_>>().join(", "),
            x: Axis::linear("time (s)"),
            y: Axis::logarithmic("position error (mm)"),
            layers,
            ..Panel::default()
        });
    }
    // All panels have one scale, so that they can be compared.
    let values = panels.iter().flat_map(|panel| &panel.layers).flat_map(Layer::reach).map(|point| point[1]);
    let [low, high] = values.filter(|v| *v > 0.0).fold([f64::INFINITY, 0.0_f64], |[l, h], v| [l.min(v), h.max(v)]);
    if low < high {
        panels.iter_mut().for_each(|panel| panel.y.range = Some([low * 0.9, high * 1.1]));
    }
    let chart = Chart {
        panels,
        columns: 1,
        page: true,
        shape: 0.3,
        legend: vec![
            Entry::line("navigated", 0),
            Entry::line("odometry only, from the first fix", 1),
            Entry::mark("fix", 2),
        ],
    };
    let message = "Camera position error relative to the object of the last fix, navigated and by odometry only from the first fix. Gaps are times without a pose.";
    finish("sawtooth", caption(message), &chart, data)
}
