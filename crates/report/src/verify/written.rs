//! The values of keys that only written answers have.

use std::collections::BTreeSet;

use seafix_evaluation::quantile;
use seafix_log::Outcome;

use super::{
    logs::{Log, Row},
    rows::{found, rows, value},
};
use crate::{answer::Operation, field::Field, proportion};

/// The evaluation of a key over logs.
type Evaluate = fn(&str, [u64; 2], &[&Log]) -> Option<Option<f64>>;

/// The value of `OPERATION N | A | B`: A over the first N logs, B over the others.
pub(super) fn combined(of: &str, span: [u64; 2], logs: &[&Log], answer: Evaluate) -> Option<f64> {
    let mut parts = of.split(" | ");
    let (head, first, second) = (parts.next()?, parts.next()?, parts.next()?);
    let (name, n) = head.split_once(' ')?;
    let operation = Operation::ALL.into_iter().find(|operation| operation.name() == name)?;
    let (own, others) = logs.split_at_checked(n.parse().ok()?)?;
    let value = operation.of(answer(first, span, own)??, answer(second, span, others)??);
    parts.next().is_none().then_some(value)
}

/// The smallest or the largest value of a quantity over single logs.
pub(super) fn extreme(name: &str, of: &str, span: [u64; 2], logs: &[&Log], answer: Evaluate) -> Option<Option<f64>> {
    let each: Option<Vec<Option<f64>>> = logs.iter().map(|log| answer(of, span, &[log])).collect();
    let each = each?.into_iter().flatten();
    Some(each.reduce(if name == "smallest-of" { f64::min } else { f64::max }))
}

/// A count, a rate, or a median of a quantity (SI), of the first log over the attempts at targets of frames that all logs have.
pub(super) fn in_common(which: &str, group: &str, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let (own, others) = logs.split_first()?;
    let keys = |log: &Log| -> BTreeSet<(u64, String)> { attempts(log, span).map(|(key, _)| key).collect() };
    let sets: Vec<BTreeSet<(u64, String)>> = others.iter().map(|log| keys(log)).collect();
    let own_rows = attempts(own, span).filter(|(key, _)| sets.iter().all(|set| set.contains(key))).map(|(_, row)| row);
    let trajectory = proportion::is_trajectory(&own.header);
    if let Some(field) = Field::named(group) {
        let mut values: Vec<f64> =
            own_rows.filter(|row| found(&row.record)).filter_map(|row| value(row, field)).collect();
        let ends = proportion::median_interval(trajectory, &mut values);
        return Some(match which {
            "median" => ends.map(|_| quantile(&mut values, 0.5)),
            "median-low" => ends.map(|ends| ends.0),
            _ => ends.map(|ends| ends.1),
        });
    }
    let is = |row: &Row| match group {
        "attempted" => true,
        "wrong" => row.record.outcome == Outcome::Fix && !found(&row.record),
        _ => found(&row.record),
    };
    let events: Vec<bool> = own_rows.map(is).collect();
    if which == "count" {
        return Some(Some(events.iter().filter(|event| **event).count() as f64));
    }
    let place = ["percent", "low", "high"].iter().position(|name| *name == which)?;
    Some(proportion::rate(trajectory, &events).map(|rate| rate[place]))
}

/// The attempts of a log with their keys: the frame and the object.
fn attempts(log: &Log, span: [u64; 2]) -> impl Iterator<Item = ((u64, String), &Row)> {
    log.sample(span)
        .flat_map(|frame| frame.rows.iter().map(move |row| ((frame.number, row.record.object.clone()), row)))
}

/// The F1 score of the identified points: 2 correct / (identified by fixes + visible in all attempts).
pub(super) fn f1(log: &Log, span: [u64; 2]) -> Option<f64> {
    let sum = |field: Field, fixes: bool| -> f64 {
        let own = rows(log, span).filter(|row| !fixes || row.record.outcome == Outcome::Fix);
        own.filter_map(|row| field.of(&row.record)).sum()
    };
    let all = sum(Field::Identified, true) + sum(Field::Visible, false);
    (all > 0.0).then(|| 2.0 * sum(Field::Correct, true) / all)
}
