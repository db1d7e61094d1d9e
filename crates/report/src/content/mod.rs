//! The content of a report, section by section.

mod ablation;
mod abstract_;
mod answer;
mod breakdown;
mod data;
mod failures;
mod figures;
mod hypotheses;
mod inspection;
mod integrity;
mod limits;
mod method;
mod navigation;
mod objects;
mod phrases;
mod protocol;
mod reach;
mod reproduce;
mod results;
mod significance;
mod threats;
mod time;

pub(crate) use breakdown::BORNE;

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::{
    ReportError, RunSummary,
    document::{Document, Section},
    paired::{self, Comparison},
    run::Run,
};

/// The report on a run.
///
/// A `small` one has few small pictures and no text that depends on the program's version.
pub(crate) fn document(run: &Run, summary: &RunSummary, small: bool) -> Result<Document, ReportError> {
    let header = run.header();
    let title = if header.title.is_empty() { &header.run } else { &header.title };
    let (comparisons, failures) = rayon::join(|| paired::comparisons(run, summary), || failures::section(run, small));
    let (picture, failures) = failures?;
    let mut method = method::section(run);
    method.blocks.splice(0..0, picture);
    // Some sections take a second each for a million rows.
    let made: [&(dyn Fn() -> Option<Section> + Sync); _] = [
        &|| Some(data::section(run, summary, small)),
        &|| Some(protocol::section(run, &comparisons)),
        &|| Some(results::section(run, summary, &comparisons)),
        &|| integrity::section(run, summary),
        &|| objects::section(run, summary),
        &|| navigation::section(run, summary),
        &|| inspection::section(run, summary),
        &|| significance::section(run, &comparisons),
        &|| ablation::section(run, summary),
    ];
    let made: Vec<Option<Section>> = made.par_iter().map(|section| section()).collect();
    let before = [hypotheses::section(run, &comparisons), method];
    let after = [
        failures,
        time::section(run, summary),
        threats::section(run, summary, &comparisons),
        reproduce::section(run),
        reproduce::configuration(run),
    ];
    Ok(Document {
        title: sentence_case(title),
        run: header.run.clone(),
        question: header.question.clone(),
        summary: abstract_::section(run, summary, &comparisons),
        sections: before.into_iter().chain(made.into_iter().flatten()).chain(after).collect(),
    })
}

/// The sentences of the abstract.
pub(crate) fn findings(run: &Run, summary: &RunSummary) -> Vec<crate::document::Text> {
    abstract_::section(run, summary, &paired::comparisons(run, summary))
}

/// The distinct texts in the order of their first appearance.
pub(crate) fn distinct(texts: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut seen = Vec::new();
    for text in texts {
        if !seen.contains(&text) {
            seen.push(text);
        }
    }
    seen
}

/// `text` with a capital first letter.
fn sentence_case(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Whether `index` is significantly better than every trial of its group.
fn best(comparisons: &[Comparison], index: usize) -> bool {
    let is_of = |c: &&Comparison| !c.over_conditions && !c.between_conditions;
    let own: Vec<&Comparison> =
        comparisons.iter().filter(is_of).filter(|c| c.first == index || c.second == index).collect();
    let Some(condition) = own.first().map(|c| &c.condition) else { return false };
    // In a large group each trial is compared with the first only, so no trial is known to be the best.
    let family = comparisons.iter().filter(is_of).filter(|c| c.condition == *condition);
    let members: BTreeSet<usize> = family.flat_map(|c| [c.first, c.second]).collect();
    own.len() + 1 == members.len() && own.iter().all(|c| c.better() == Some(index))
}
