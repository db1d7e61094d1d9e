//! The main figure of the first page.

use crate::document::{Block, Section};

/// The figures that are the main figure of any run, the best first.
const COMMON: [&str; 8] = [
    "error-over-noise",
    "sawtooth",
    "error-over-condition",
    "success",
    "rates",
    "recall",
    "error-over-frames",
    "distribution",
];

/// Takes the first existing figure of these names out of its section; `None` for a run without any.
pub(super) fn take(wanted: &[&str], sections: &mut [Section]) -> Option<Block> {
    wanted.iter().chain(&COMMON).find_map(|id| {
        sections.iter_mut().find_map(|section| {
            let is = |block: &Block| matches!(block, Block::Figure(figure) if figure.id == *id);
            section.blocks.iter().position(is).map(|place| section.blocks.remove(place))
        })
    })
}
