//! The abstract: the question's answer in numbers.

use super::{
    distinct,
    tell::{self, Unit},
};
use crate::{
    Field, Number, PAPER_M1, Row, Spread, Summary,
    document::{Text, text},
    format::{decimals, number},
    paper,
    run::{Run, Trial},
};

pub(super) fn section(run: &Run, summary: &Summary) -> Vec<Text> {
    let trials: Vec<&Trial> = run.trials.iter().collect();
    let total = |count: fn(&Row) -> usize| summary.rows.iter().map(count).sum::<usize>();
    let pooled =
        |group: &str, n: usize| Number::count(n, tell::over(&trials, "/metrics/evaluation", format!("count {group}")));
    let attempted = total(|row| row.attempted);
    let mut first = text![
        format!("In {} trial{} with ", trials.len(), if trials.len() == 1 { "" } else { "s" }),
        pooled("frames", total(|row| row.frames)),
        " frames, ",
        pooled("attempted", attempted),
        " targets were attempted: "
    ];
    let groups =
        [("found", total(|row| row.found)), ("refused", total(|row| row.refused)), ("wrong", total(|row| row.wrong))];
    for (index, (group, n)) in groups.into_iter().enumerate() {
        let key = tell::over(&trials, "/metrics/evaluation", format!("percent {group} of attempted"));
        let share = (attempted > 0).then(|| 100.0 * n as f64 / attempted as f64);
        first.extend(text![pooled(group, n), format!(" {group} ("), Number::new(share, 1, key), " %"]);
        // Trials may share their frames, and then they are no independent draws: pooled counts carry no interval.
        if let [trial] = trials[..] {
            let [low, high] = tell::interval(trial, group, n, attempted);
            first.extend(text![", 95 % interval [", low, ", ", high, "]"]);
        }
        first.push(["), ", "), ", "). "][index].into());
    }
    if trials.len() > 1 {
        first.push(
            "These counts pool trials that may share their frames; intervals stand with each trial below. ".into(),
        );
    }
    if total(|row| row.unjudged) > 0 {
        first.extend(text!["No truth judges ", pooled("unjudged", total(|row| row.unjudged)), " of the fixes found."]);
    }
    let methods = distinct(summary.rows.iter().map(Row::method));
    let mut texts = vec![first];
    for method in methods.iter().take(4) {
        let own = |index: &usize| summary.rows[*index].method() == *method;
        let rows: Vec<usize> = (0..summary.rows.len()).filter(own).collect();
        texts.extend(sentence(run, summary, method, &rows));
    }
    let [low, high] = PAPER_M1.map(|m| number(Some(m * 1e3), 0));
    texts.push(text![format!(
        "The paper reports m1 of {low}–{high} mm in its virtual scene at 2–5 m, and neither rates nor the error of the vehicle’s pose ({}).",
        paper::CITATION
    )]);
    texts
}

/// The medians of one method over its trials: the least and the greatest.
fn sentence(run: &Run, summary: &Summary, method: &str, rows: &[usize]) -> Option<Text> {
    let trials: Vec<&Trial> = rows.iter().map(|&index| &run.trials[index]).collect();
    let range = |field: Field, value: fn(&Row) -> Option<Spread>, (unit, suffix): (Unit, &str)| -> Option<Text> {
        let medians = rows.iter().filter_map(|&index| value(&summary.rows[index]));
        let medians: Vec<f64> = medians.map(|spread| spread.median * unit.scale()).collect();
        let digits = decimals(medians.iter().copied());
        let [low, high] = medians.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &m| [a.min(m), b.max(m)]);
        let end = |which: &str, value: f64| {
            let what = format!(
                "{which} median {} of found in {}",
                field.name(),
                if unit == Unit::Degrees { "deg" } else { "mm" }
            );
            Number::new(Some(value), digits, tell::over(&trials, field.topic(), what))
        };
        let (first, last) = (end("least", low), end("greatest", high));
        (!medians.is_empty())
            .then(|| if first.text == last.text { text![first, suffix] } else { text![first, " to ", last, suffix] })
    };
    let metric = (Unit::Millimetres, " mm");
    let mut said = text![format!("With {method} the medians of the fixes found are m1 ")];
    said.extend(range(Field::M1, |row| row.m1, metric)?);
    if let Some(m2) = range(Field::M2, |row| row.m2, metric) {
        said.push(", m2 ".into());
        said.extend(m2);
    }
    let position = range(Field::Position, |row| row.m3_position, metric);
    let attitude = range(Field::Attitude, |row| row.m3_attitude, (Unit::Degrees, "°"));
    if let (Some(position), Some(attitude)) = (position, attitude) {
        said.push(", camera position ".into());
        said.extend(position);
        said.push(" and attitude ".into());
        said.extend(attitude);
    }
    said.push(".".into());
    Some(said)
}
