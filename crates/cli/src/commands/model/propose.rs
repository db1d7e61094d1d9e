//! Proposals of features to mark in a dive.

use seafix_component::Fault;
use seafix_data::{Proposal, Proposer};
use seafix_vision::FrontEnd;

use super::{arguments::Model, dive, page};
use crate::{
    atomic_file::AtomicFile,
    exit::{DONE, Ended, Failure, INPUT, OUTPUT},
    terminal::{Progress, notify, print},
};

const INTRODUCTION: &str = "Delete the lines of features that the object should not have, and rename the others. The letter \
                            is that of a group of features within two metres.";

/// Proposes features, and writes them as marks and as a page of pictures.
pub(super) fn execute(model: &Model, count: usize, front_end: &FrontEnd) -> Ended {
    let pairs = dive::opened(model)?;
    let odometry = model.dive.odometry(&pairs)?;
    let inputs = [&*model.left];
    let out = model.out.as_deref().map(|path| AtomicFile::begin(path, model.replacing, &inputs)).transpose()?;
    let sheet = model.dive.page.as_deref().map(|path| AtomicFile::begin(path, model.replacing, &inputs)).transpose()?;
    let proposer = Proposer { front_end, odometry: odometry.as_deref(), reach: model.reach, count };
    let progress = Progress::new();
    progress.expect(pairs.stamps().len());
    let (proposals, unread) = model.dive.pool()?.install(|| proposer.propose(&pairs, &mut || progress.step("")));
    progress.end();
    unread.iter().for_each(|fault| notify(&format!("warning: {fault}")));
    if proposals.is_empty() {
        if odometry.is_none() {
            let fault = Fault::new("no feature to propose: no pair shows a corner in both images", pairs.path());
            return Err(Failure::new(INPUT, fault.remedy("mark features by hand")));
        }
        let fault = Fault::new(
            "no feature to propose: none has five pairs, a parallax of 15° and a standard deviation of 2 mm",
            pairs.path(),
        );
        return Err(Failure::new(INPUT, fault.remedy("pass the object on crossing paths, or mark features by hand")));
    }
    if let Some(sheet) = sheet {
        let entries: Vec<page::Entry<'_>> = proposals.iter().map(entry).collect();
        let name = pairs.path().file_name().unwrap_or(pairs.path().as_os_str());
        let title = format!("Proposed features of {}", name.display());
        let text = page::page(&title, INTRODUCTION, &entries).map_err(|message| Failure::new(OUTPUT, message))?;
        sheet.finish(text)?;
    }
    let marks = marks(&proposals);
    match out {
        Some(out) => {
            out.finish(marks)?;
            print(&format!("{} proposals\n", proposals.len()))?;
        }
        None => print(&marks)?,
    }
    Ok(DONE)
}

fn entry(proposal: &Proposal) -> page::Entry<'_> {
    let line = format!(
        "{} views, {:.0}° apart, σ {:.1} mm",
        proposal.views,
        proposal.parallax.to_degrees(),
        proposal.sigma * 1e3
    );
    page::Entry { id: &proposal.id, lines: vec![line], pictures: proposal.picture.iter().collect() }
}

/// The proposals as marks, whose right positions are matched.
fn marks(proposals: &[Proposal]) -> String {
    let line = |proposal: &Proposal| {
        let Proposal { id, stamp_ns, left, .. } = proposal;
        format!("{stamp_ns},{id},{:.2},{:.2},,\n", left.u, left.v)
    };
    "stamp_ns,id,left_u,left_v,right_u,right_v\n".to_owned() + &proposals.iter().map(line).collect::<String>()
}
