//! The common parts of figures: captions, panels and series.

use crate::{
    document::{Figure, Table, Text, text},
    figure::{Axis, Chart, Panel},
    paired,
    run::{Run, Trial},
};

/// A figure from its caption, chart and data; `None` for an empty chart.
pub(crate) fn figure(id: &str, caption: Text, chart: &Chart, data: Table) -> Option<Figure> {
    Some(Figure { id: id.to_owned(), caption, drawing: chart.draw()?, data })
}

/// The groups of trials on the same frames with the names of their members, at most `max` groups.
pub(crate) fn panels(run: &Run, max: usize) -> Vec<(String, Vec<(String, &Trial)>)> {
    let groups = paired::groups(run);
    // With many conditions, the first, the last and evenly spaced ones between are kept.
    let step = groups.len().div_ceil(max).max(1);
    let chosen = groups.iter().step_by(step);
    chosen
        .map(|members| {
            let (condition, names) = paired::names(run, members);
            (condition, names.into_iter().zip(members.iter().map(|&index| &run.trials[index])).collect())
        })
        .collect()
}

/// A caption. Source and camera are those of the section on data.
pub(crate) fn caption(message: &str) -> Text {
    text![message]
}

/// The index of the series with a name.
pub(crate) fn series(names: &[String], name: &str) -> usize {
    names.iter().position(|known| known == name).unwrap_or(0)
}

/// Gives all panels the same axis ranges.
pub(crate) fn same_axes(panels: &mut [Panel]) {
    let values = |which: usize| {
        panels
            .iter()
            .flat_map(|panel| &panel.layers)
            .flat_map(|layer| layer.reach())
            .map(move |point| point[which])
            .collect::<Vec<_>>()
    };
    let Some(first) = panels.first() else { return };
    let (x, y) = (first.x.ends(values(0).into_iter()), first.y.ends(values(1).into_iter()));
    for panel in panels {
        let power =
            |axis: &Axis, ends: [f64; 2]| if axis.logarithmic { ends.map(|end| 10_f64.powf(end)) } else { ends };
        panel.x.range = Some(power(&panel.x, x));
        panel.y.range = Some(power(&panel.y, y));
    }
}
