//! The figures of the results; a figure without data in the logs is omitted.

mod axis;
mod consistency;
pub(crate) mod cost;
mod frames;
mod grid;
pub(crate) mod layout;
mod probability;
mod rates;
mod recall;
pub(crate) mod sawtooth;
pub(crate) mod tolerance;
mod trajectory;

use rayon::prelude::*;

use crate::{
    document::{Block, Figure},
    run::Run,
    summary::RunSummary,
};

/// The figures of rates alone.
const RATES: [&str; 2] = ["rates", "success"];

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
        &|| probability::roc(run, summary),
        &|| probability::reliability(run, summary),
        &|| grid::figure(run, summary),
        &|| trajectory::figure(run),
        &|| consistency::histogram(run),
        &|| consistency::coverage(run),
    ];
    let plotted: Vec<Option<Figure>> = all.par_iter().map(|figure| figure()).collect();
    let mut blocks: Vec<Block> = plotted.into_iter().flatten().map(Block::Figure).collect();
    // A figure whose values are all equal says less than a sentence.
    if let Some(sentence) = rates::uniform(run, summary) {
        blocks.retain(|block| !matches!(block, Block::Figure(figure) if RATES.contains(&figure.id.as_str())));
        blocks.insert(0, Block::Paragraph(sentence));
    }
    blocks
}
