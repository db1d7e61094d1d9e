//! The table of limits of the probability of a wrong answer.

use super::{acceptance::methods, cells::rate_of, measured::Sample};
use crate::{
    document::{Block, Cell, Head, Table, text},
    run::Run,
    summary::RunSummary,
};

/// Maximum number of lines with intervals; more have the rates alone.
const WITH_INTERVALS: usize = 8;

/// A line for every method and limit: fixes and wrong fixes of objects in view, and answers without an object.
pub(super) fn table(run: &Run, summary: &RunSummary, key: &str) -> Option<Block> {
    let methods = methods(summary, key);
    let lines = || methods.iter().flat_map(|(method, limits)| limits.iter().map(move |limit| (method, limit)));
    let absent = lines().any(|(_, limit)| !limit.absent.is_empty());
    let intervals = lines().count() <= WITH_INTERVALS;
    let mut heads = vec![Head::words(""), Head::words("limit"), Head::numbers("objects in view")];
    heads.extend(["fixes (%)", "wrong (%)"].map(Head::numbers));
    if absent {
        heads.extend(["frames without the object", "answered (%)"].map(Head::numbers));
    }
    let rates = match absent {
        true => "Fixes and wrong fixes in % of the objects in view, and answers in % of the frames without the object",
        false => "Fixes and wrong fixes in % of the attempts",
    };
    let caption = format!("{rates}{}", if intervals { ", with 95 % intervals." } else { "." });
    let mut table = Table::new("answer", text![caption], heads);
    let mut before = "";
    for (method, limit) in lines() {
        let [present, without] = [&limit.present, &limit.absent].map(|members| Sample::of(run, summary, members));
        let rate = |sample: &Sample<'_>, wrong: bool| {
            let rate = if wrong { sample.wrong_rate() } else { sample.measured() };
            let text = if intervals { rate_of(sample, rate) } else { text![rate.number()] };
            Cell { text, ..Cell::default() }
        };
        let begins = before != method;
        let name = if begins { method.clone() } else { String::new() };
        let mut cells: Vec<Cell> = vec![name.into(), limit.name.clone().into(), present.n().into()];
        cells.extend([rate(&present, false), rate(&present, true)]);
        if absent {
            cells.extend([without.n().into(), rate(&without, true)]);
        }
        table.line(begins && !before.is_empty(), cells);
        before = method;
    }
    Some(Block::Table(table))
}
