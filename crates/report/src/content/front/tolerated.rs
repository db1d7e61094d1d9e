//! The answer about errors that a fix tolerates: the first case against each other one, in pose and in residuals.

use super::{
    contrast::{Contrast, Ranked},
    measured::{capitalised, error, median_of, wrong},
    ranking::{Case, names},
};
use crate::{
    content::{conditions::labels::Labels, phrases::Unit},
    document::{Text, text},
    field::Field,
    run::Run,
    summary::{Row, RunSummary},
};

/// What a case does to the error of the pose and to the residuals of the points.
struct Effect {
    case: Case,
    /// The median error of the pose.
    pose: Text,
    /// Whether the error is significantly larger than in the first case, and whether the residuals are.
    larger: [bool; 2],
    /// Whether it has significantly fewer fixes.
    fewer: bool,
}

/// The cases without a larger error than the first case, and of the others those that the residuals show; `None` without
/// fixes in the first case.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let (name, field, of) = error(summary);
    let contrast = Contrast { run, summary };
    let median =
        |index: usize, ranked: Ranked| median_of(summary, &run.trials[index], ranked, (Unit::Millimetres, " mm"));
    let case = |index: usize| Case {
        name: labels.of_series(&summary.rows[index]),
        value: median(index, (field, of)),
        members: vec![index],
        tail: Text::new(),
    };
    let count = summary.rows.len();
    let exact = case(0);
    of(&summary.rows[0])?;
    let effect = |index: usize| {
        let own = case(index);
        let larger = [(field, of), (Field::Fit, (|row: &Row| row.fit) as _)].map(|ranked: Ranked| {
            let grows = median(index, ranked).value() > median(0, ranked).value();
            grows && contrast.values_differ(ranked, [&own, &exact], count)
        });
        let fewer = summary.rows[index].found < summary.rows[0].found
            && contrast.rates_differ(&own.members, &exact.members, count);
        Effect { pose: own.value.text(), larger, fewer, case: own }
    };
    let effects: Vec<Effect> = (1..count).map(effect).collect();
    let mut message = text![format!("compared with {}, whose median {name} is ", exact.name)];
    message.extend(exact.value.text());
    let mut separator = ": ";
    for (larger, words) in [
        (
            [false, false],
            "neither this error nor the residuals of the points (fit RMS) are shown to be larger with ".to_owned(),
        ),
        ([false, true], format!("the residuals are larger, and a larger {name} is not shown, with ")),
        ([true, true], "both are larger with ".to_owned()),
        ([true, false], format!("the {name} is larger, and larger residuals are not shown, with ")),
    ] {
        let own: Vec<&Effect> = effects.iter().filter(|effect| effect.larger == larger).collect();
        for (place, effect) in own.iter().enumerate() {
            message.push(if place > 0 { ", ".into() } else { format!("{separator}{words}").into() });
            separator = "; ";
            message.push(format!("“{}” (", effect.case.name).into());
            message.extend(effect.pose.clone());
            message.push(")".into());
        }
    }
    let fewer: Vec<&str> =
        effects.iter().filter(|effect| effect.fewer).map(|effect| effect.case.name.as_str()).collect();
    message.push(match fewer.len() {
        0 => "; no case has significantly fewer fixes".into(),
        _ => format!("; significantly fewer fixes have {}", names(fewer.into_iter())).into(),
    });
    let tre = |index: &usize| contrast.values_differ((Field::Tre, |row| row.tre), [&case(*index), &exact], count);
    let moved: Vec<String> = (1..count).filter(tre).map(|index| case(index).name).collect();
    if field != Field::Tre && !moved.is_empty() {
        let which = match moved.len() + 1 {
            all if all == count => "every one of them".to_owned(),
            _ => names(moved.iter().map(String::as_str)),
        };
        message.push(format!("; the error of the model points (TRE) differs significantly with {which}").into());
    }
    message.retain(|span| !span.plain().is_empty());
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}
