//! The table of limits of the probability of a wrong answer.

use super::{acceptance::limits, measured::Sample, table::rate_of};
use crate::{
    document::{Block, Cell, Head, Table, text},
    run::Run,
    summary::RunSummary,
};

/// A line for every limit: fixes and wrong fixes of objects in view, and answers without an object.
pub(super) fn table(run: &Run, summary: &RunSummary, key: &str) -> Option<Block> {
    let limits = limits(summary, key);
    let absent = limits.iter().any(|limit| !limit.absent.is_empty());
    let mut heads = vec![Head::words("limit"), Head::numbers("objects in view")];
    heads.extend(["fixes (%)", "wrong (%)"].map(Head::numbers));
    if absent {
        heads.extend(["without the object", "answered (%)"].map(Head::numbers));
    }
    let caption = "Fixes and wrong fixes in % of the objects in view, and answers in % of the frames without the object, with 95 % intervals.";
    let caption = if absent { caption } else { "Fixes and wrong fixes in % of the attempts, with 95 % intervals." };
    let mut table = Table::new("answer", text![caption], heads);
    for limit in limits {
        let sample = |members: &[usize]| Sample::of(run, summary, members);
        let present = sample(&limit.present);
        let mut cells: Vec<Cell> = vec![limit.name.clone().into(), present.n().into()];
        let rates = [present.measured(), present.wrong_rate()];
        cells.extend(rates.map(|rate| Cell { text: rate_of(&present, rate), ..Cell::default() }));
        if absent {
            let without = sample(&limit.absent);
            cells.push(without.n().into());
            cells.push(Cell { text: rate_of(&without, without.wrong_rate()), ..Cell::default() });
        }
        table.line(false, cells);
    }
    Some(Block::Table(table))
}
