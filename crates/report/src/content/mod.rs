//! The content of a report: the first page, then the appendix, section by section.

mod conditions;
mod figures;
mod findings;
mod front;
mod phrases;
mod sections;

use rayon::prelude::*;

use findings::abstract_;
use sections::{
    ablation, data, failures, hypotheses, inspection, integrity, method, navigation, objects, protocol, reproduce,
    results, significance, threats, time,
};

use crate::{
    document::{Document, Section, Text},
    error::ReportError,
    format::sentence_case,
    paired,
    run::Run,
    summary::RunSummary,
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
    let mut findings = Section::new("Findings");
    abstract_::section(run, summary, &comparisons).into_iter().for_each(|text| findings.say(text));
    let before = [findings, hypotheses::section(run, &comparisons), method];
    let after = [
        failures,
        time::section(run, summary),
        threats::section(run, summary, &comparisons),
        reproduce::section(run),
        reproduce::configuration(run),
    ];
    let mut sections: Vec<Section> = before.into_iter().chain(made.into_iter().flatten()).chain(after).collect();
    Ok(Document {
        title: sentence_case(title),
        run: header.run.clone(),
        question: header.question.clone(),
        front: front::blocks(run, summary, &comparisons, &mut sections),
        sections,
    })
}

/// The answer to the question of the experiment, then the sentences of the findings.
pub(crate) fn findings(run: &Run, summary: &RunSummary) -> (Text, Vec<Text>) {
    (front::answer(run, summary), abstract_::section(run, summary, &paired::comparisons(run, summary)))
}
