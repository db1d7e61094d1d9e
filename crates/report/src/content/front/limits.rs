//! The answer about solvers beside the Cramér–Rao bound.

use super::measured::capitalised;
use crate::{
    content::phrases,
    document::{Text, text},
    format::distinct,
    number::Number,
    run::{Run, Trial},
    summary::{Row, RunSummary},
};

/// The methods with the smallest and the largest ratio of RMS camera position error to its bound, over all conditions.
pub(super) fn sentence(run: &Run, summary: &RunSummary) -> Option<Text> {
    let of_method = |method: String| {
        let own = |index: &usize| summary.rows[*index].method() == method && summary.rows[*index].limits.is_some();
        let own: Vec<usize> = (0..summary.rows.len()).filter(own).collect();
        let trials: Vec<&Trial> = own.iter().map(|&index| &run.trials[index]).collect();
        let ratios: Vec<f64> = own
            .iter()
            .filter_map(|&index| summary.rows[index].limits)
            .map(|limits| limits.position[0] / limits.position[1])
            .collect();
        let ends = [("least", f64::min as fn(f64, f64) -> f64), ("greatest", f64::max)].map(|(which, pick)| {
            let what = format!("{which} ratio position_error of judged");
            Number::new(ratios.iter().copied().reduce(pick), 3, phrases::over(&trials, "/metrics/totals", what))
        });
        (!own.is_empty()).then_some((method, ends))
    };
    let methods = distinct(summary.rows.iter().map(Row::method));
    let mut known: Vec<(String, [Number; 2])> = methods.into_iter().filter_map(of_method).collect();
    known.sort_by(|a, b| a.1[1].value.unwrap_or(f64::NAN).total_cmp(&b.1[1].value.unwrap_or(f64::NAN)));
    let clause = |(method, [low, high]): (String, [Number; 2])| {
        text![format!("with {method} it is "), low, " to ", high, " times this bound"]
    };
    let worst = if known.len() > 1 { known.pop() } else { None };
    let (method, [low, high]) = known.into_iter().next()?;
    let mut message = text![
        format!("with {method} the RMS camera position error is "),
        low,
        " to ",
        high,
        " times the Cramér–Rao bound"
    ];
    if let Some(worst) = worst {
        message.push("; ".into());
        message.extend(clause(worst));
    }
    Some(capitalised(message))
}
