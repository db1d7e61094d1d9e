//! The figures of the results; a figure without data in the logs is omitted.

mod axis;
mod consistency;
pub(crate) mod cost;
mod frames;
mod grid;
pub(crate) mod layout;
mod rates;
mod recall;
pub(crate) mod sawtooth;
mod tolerance;
mod trajectory;

use rayon::prelude::*;

use crate::{
    document::{Block, Figure},
    run::Run,
    summary::RunSummary,
};

/// The figures of the section with the results.
pub(crate) fn blocks(run: &Run, summary: &RunSummary) -> Vec<Block> {
    let main = || {
        if summary.has_limits() { None } else { axis::errors(run, summary).or_else(|| frames::errors(run)) }
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
