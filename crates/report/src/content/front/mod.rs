//! The first page: the answer in one sentence, the main figure, a small table, the conclusion and its limits.

mod acceptance;
mod along;
mod authored;
mod cases;
mod cells;
mod company;
mod conclusion;
mod contrast;
mod cost;
mod diverging;
mod drifted;
mod families;
mod figure;
mod grid;
mod kind;
mod limited;
mod limits;
mod measured;
mod navigated;
mod objects;
mod outliers;
mod points;
mod ranking;
mod table;
mod tolerance;
mod tolerated;

use crate::{
    content::conditions::labels::Labels,
    document::{Block, Section, Span, Text, bold},
    paired::Comparison,
    run::Run,
    summary::RunSummary,
};
use kind::{Asked, Kind};

pub(crate) use acceptance::is_absent;
pub(crate) use authored::{Authored, Checked};

/// The blocks of the first page; the main figure is taken from the section that has it.
///
/// A written answer takes the place of the generated answer and conclusion.
pub(crate) fn blocks(
    run: &Run,
    summary: &RunSummary,
    comparisons: &[Comparison],
    sections: &mut [Section],
    authored: Option<&Authored>,
) -> Vec<Block> {
    let text = authored.map_or_else(|| answer(run, summary), |authored| authored.text.clone());
    let mut blocks = vec![Block::Paragraph(emphasised(text))];
    let figures = Kind::of(run, summary).figures(Asked::of(&summary.question));
    blocks.extend(figure::take(figures, sections));
    blocks.extend(table::block(run, summary));
    blocks
        .extend(conclusion::sentences(run, summary, comparisons, authored.is_none()).into_iter().map(Block::Paragraph));
    blocks
}

/// The answer to the question of the experiment, in one sentence with its numbers and intervals.
///
/// Its form follows from what the logs hold and from the words of the question.
pub(crate) fn answer(run: &Run, summary: &RunSummary) -> Text {
    let labels = Labels::of(summary);
    let asked = Asked::of(&summary.question);
    let special = match Kind::of(run, summary) {
        Kind::Limits => limits::sentence(run, summary),
        Kind::Points => points::sentence(run, summary, &labels),
        Kind::Objects => objects::sentence(run, summary, &labels),
        Kind::Navigation => navigated::sentence(run, summary, &labels, asked),
        Kind::Cost => cost::sentence(run, summary, &labels),
        Kind::Tolerance(key) => tolerance::sentence(run, summary, &key),
        Kind::Acceptance(key) => acceptance::sentence(run, summary, &key),
        Kind::Outliers(key) => outliers::sentence(run, summary, &labels, &key),
        Kind::Along(key) => along::sentence(run, summary, &labels, &key, asked),
        Kind::Families(key) => families::sentence(run, summary, &labels, &key),
        Kind::Cases if asked.tolerates => tolerated::sentence(run, summary, &labels),
        Kind::Cases => None,
    };
    let mut text = special.or_else(|| cases::sentence(run, summary, &labels, asked)).unwrap_or_else(|| {
        let frames = summary.rows.iter().map(|row| row.frames).sum::<usize>();
        vec![format!("None of {frames} frames has an attempt at a fix").into()]
    });
    text.push(".".into());
    text
}

/// The words of a text in bold; numbers keep their keys.
fn emphasised(text: Text) -> Text {
    let strong = |span| match span {
        Span::Plain(text) => bold(text),
        Span::Number(number) => Span::Best(number),
        span => span,
    };
    text.into_iter().map(strong).collect()
}
