//! The figures of the results; a figure without data in the logs is omitted.

mod axis;
mod consistency;
mod cost;
mod frames;
mod grid;
mod rates;
mod recall;
mod sawtooth;
mod tolerance;
mod trajectory;

use rayon::prelude::*;

use crate::{
    RunSummary,
    document::{Block, Figure, Text, text},
    paired,
    run::{Run, Trial},
};

use super::{data::baseline, distinct};

pub(super) use axis::{keys, name, numeric, on};
pub(super) use cost::search_cost;
pub(super) use sawtooth::figure as sawtooth;

/// The figures of the section with the results.
pub(super) fn blocks(run: &Run, summary: &RunSummary) -> Vec<Block> {
    let main = || {
        if super::limits::known(summary) { None } else { axis::errors(run, summary).or_else(|| frames::errors(run)) }
    };
    let all: [&(dyn Fn() -> Option<Figure> + Sync); _] = [
        &main,
        &|| rates::figure(run, summary),
        &|| axis::boxes(run, summary),
        &|| recall::figure(run),
        &|| tolerance::precision_recall(run, summary),
        &|| grid::figure(run, summary),
        &|| trajectory::figure(run),
        &|| consistency::histogram(run),
        &|| consistency::coverage(run),
    ];
    let plotted: Vec<Option<Figure>> = all.par_iter().map(|figure| figure()).collect();
    plotted.into_iter().flatten().map(Block::Figure).collect()
}

/// A sentence on source, camera, baseline and number of frames.
fn conditions(run: &Run) -> String {
    let rig = &run.header().rig;
    let sources = distinct(run.trials.iter().map(|trial| trial.header.source.clone())).join("; ");
    let frames = distinct(run.trials.iter().map(|trial| trial.count().to_string())).join(" or ");
    format!(
        "Source: {sources}; {} × {} px, f = {:.0} px, baseline {:.2} m; {frames} frames per trial.",
        rig.left.size[0],
        rig.left.size[1],
        rig.left.matrix[0][0],
        baseline(run.header())
    )
}

/// A figure from its caption, chart and data; `None` for an empty chart.
pub(super) fn figure(
    id: &str,
    caption: Text,
    chart: &crate::figure::Chart,
    data: crate::document::Table,
) -> Option<Figure> {
    Some(Figure { id: id.to_owned(), caption, drawing: chart.draw()?, data })
}

/// The groups of trials on the same frames with the names of their members, at most `max` groups.
fn panels(run: &Run, max: usize) -> Vec<(String, Vec<(String, &Trial)>)> {
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

/// A caption that ends with the sentence on source and camera.
pub(super) fn caption(message: &str, run: &Run) -> Text {
    text![format!("{message} {}", conditions(run))]
}

/// The index of the series with a name.
pub(super) fn series(names: &[String], name: &str) -> usize {
    names.iter().position(|known| known == name).unwrap_or(0)
}
