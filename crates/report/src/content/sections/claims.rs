//! The claims of a written answer, with their values.

use crate::{
    content::front::Checked,
    document::{Block, Section, Text, code, text},
};

/// The section; `None` without claims.
pub(crate) fn section(claims: &[Checked]) -> Option<Section> {
    let item = |checked: &Checked| -> Text {
        let mut item = text![code(checked.claim.clone()), ": "];
        item.extend(checked.values.clone());
        item.push(if checked.holds { "." } else { ", which does not hold." }.into());
        item
    };
    (!claims.is_empty()).then(|| {
        let mut section = Section::new("Claims of the answer");
        section.say(text![
            "The answer is written by the authors of the experiment, its numbers are computed from the logs. Its words assert these relations; a report with a relation that does not hold is not written."
        ]);
        section.with([Block::Items(claims.iter().map(item).collect())])
    })
}
