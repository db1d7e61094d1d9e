//! The reason why an attempt among the worst is there: the test that rejected it, or the false pairs behind its error.

use crate::{
    content::phrases::{self, Unit},
    document::{Text, text},
    field::Field,
    run::{AttemptRow, Frame, Trial},
};

/// The sentence on what an attempt lacked.
///
/// A rejected attempt has its logged sentence, which ends with the remedy; a fix has its points, its false pairs and
/// its protection level.
pub(crate) fn sentence(trial: &Trial, frame: &Frame, row: &AttemptRow) -> Text {
    let explanation = trial.explanation(row);
    if !row.found() && !row.wrong() {
        let why = if explanation.is_empty() { trial.reason(row) } else { explanation };
        return text![format!("rejected: {why}.")];
    }
    let place = (trial.object(row), frame.number, frame.stamp_ns);
    let value = |field, unit, digits| phrases::value(trial, place, field, row.get(field), (unit, digits));
    let count = |field| value(field, Unit::Plain, 0);
    let known = |field| row.get(field).is_some();
    // Edges alone may give a fix.
    let by_edges = row.get(Field::Identified) == Some(0.0);
    let mut message = text![if row.wrong() { "wrong fix" } else { "fix" }];
    message.extend(if by_edges {
        text![" by edges alone"]
    } else {
        text![" of ", count(Field::Identified), " points"]
    });
    if known(Field::Visible) {
        message.extend(text![", ", count(Field::Visible), if by_edges { " points in view" } else { " in view" }]);
    }
    if known(Field::Correct) && !by_edges {
        message.extend(text!["; ", count(Field::Correct), " of its pairs are correct"]);
    }
    match (row.get(Field::Position), row.get(Field::Level)) {
        (Some(error), Some(level)) => {
            let word = if error <= level { "within" } else { "beyond" };
            message.extend(text![
                format!("; its position error is {word} the protection level of "),
                value(Field::Level, Unit::Millimetres, 1),
                " mm"
            ]);
        }
        (Some(_), None) => message.push("; it has no protection level: too few points, or an indispensable one".into()),
        _ => {}
    }
    message.push(".".into());
    message
}
