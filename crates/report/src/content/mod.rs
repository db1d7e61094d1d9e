//! The content of a report: the first page, then the appendix, section by section.

mod conditions;
mod figures;
mod findings;
mod front;
mod phrases;
mod sections;

use rayon::prelude::*;

use findings::abstract_;
pub(crate) use front::Authored;
use sections::{
    ablation, claims, data, failures, hypotheses, inspection, integrity, method, navigation, objects, protocol,
    reproduce, results, significance, threats, time,
};

use crate::{
    document::{Document, Section, Text},
    error::ReportError,
    format::sentence_case,
    paired::{self, Comparison},
    run::Run,
    summary::RunSummary,
};

/// The report on a run.
///
/// A `small` one has few small pictures and no text that depends on the program's version. An `authored` answer takes the
/// place of the generated one.
pub(crate) fn document(
    run: &Run,
    summary: &RunSummary,
    small: bool,
    authored: Option<&Authored>,
) -> Result<Document, ReportError> {
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
    sentences(run, summary, &comparisons, authored).into_iter().for_each(|text| findings.say(text));
    let claims = authored.and_then(|authored| claims::section(&authored.claims));
    let before = [findings].into_iter().chain(claims).chain([hypotheses::section(run, &comparisons), method]);
    let after = [
        failures,
        time::section(run, summary),
        threats::section(run, summary, &comparisons),
        reproduce::section(run),
        reproduce::configuration(run),
    ];
    let mut sections: Vec<Section> = before.chain(made.into_iter().flatten()).chain(after).collect();
    Ok(Document {
        title: sentence_case(title),
        run: header.run.clone(),
        question: header.question.clone(),
        front: front::blocks(run, summary, &comparisons, &mut sections, authored),
        sections,
        answer: authored.map(|authored| authored.answer.clone()),
    })
}

/// The answer to the question of the experiment, then the sentences of the findings.
pub(crate) fn findings(run: &Run, summary: &RunSummary, authored: Option<&Authored>) -> (Text, Vec<Text>) {
    let answer = authored.map_or_else(|| front::answer(run, summary), |authored| authored.text.clone());
    (answer, sentences(run, summary, &paired::comparisons(run, summary), authored))
}

/// The sentences of the findings; beside a written answer, the generated one with the values of the trials comes first.
fn sentences(run: &Run, summary: &RunSummary, comparisons: &[Comparison], authored: Option<&Authored>) -> Vec<Text> {
    let generated = authored.map(|_| front::answer(run, summary));
    generated.into_iter().chain(abstract_::section(run, summary, comparisons)).collect()
}
