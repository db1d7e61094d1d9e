//! The answer about solvers beside the Cramér–Rao bound.

use super::measured::{Measured, capitalised};
use crate::{
    document::Text,
    format::distinct,
    number::{Key, Number},
    rms,
    run::{Run, Trial},
    summary::{Row, RunSummary},
};
use crate::{field::Field, proportion};
use seafix_log::Outcome;

/// The methods with the smallest and the largest ratio of RMS camera position error to its bound, over all conditions.
pub(super) fn sentence(run: &Run, summary: &RunSummary) -> Option<Text> {
    let ratio = |index: usize| Some(summary.rows[index].limits?.position).map(|[rms, bound]| rms / bound);
    // One search for all solvers is no part of their names.
    let searches = summary.rows.iter().any(|row| row.search != summary.rows[0].search);
    let name = |row: &Row| if searches { row.method() } else { row.solver.clone() };
    let of_method = |method: String| {
        let own = (0..summary.rows.len()).filter(|&index| name(&summary.rows[index]) == method);
        let mut own: Vec<(usize, f64)> = own.filter_map(|index| Some((index, ratio(index)?))).collect();
        own.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (first, last) = (own.first()?.0, own.last()?.0);
        Some((method, [first, last].map(|index| measured(&run.trials[index], &summary.rows[index]))))
    };
    let methods = distinct(summary.rows.iter().map(name));
    let mut known: Vec<(String, [Measured; 2])> = methods.into_iter().filter_map(of_method).collect();
    known.sort_by(|a, b| a.1[1].value().total_cmp(&b.1[1].value()));
    let count = known.len();
    let mut message = Text::new();
    let ends = known.into_iter().enumerate().filter(|(place, _)| *place == 0 || *place + 1 == count);
    for (place, (method, [low, high])) in ends {
        let what = if place == 0 { "the RMS camera position error is " } else { "it is " };
        message.push(format!("{}with {method} {what}", if place == 0 { "" } else { "; " }).into());
        message.extend(low.text());
        message.push(" to ".into());
        message.extend(high.text());
        let bound = if place == 0 { " times the Cramér–Rao bound" } else { " times this bound" };
        message.push(bound.into());
        if low.interval().is_some_and(|[low, _]| low <= 1.0) && high.interval().is_some_and(|[_, high]| high >= 1.0) {
            message.push(", from which it is not told apart".into());
        }
    }
    (!message.is_empty()).then(|| capitalised(message))
}

/// The ratio of a trial with its 95 % interval.
fn measured(trial: &Trial, row: &Row) -> Measured {
    let limits = row.limits.as_ref();
    let fixes = trial.attempts().map(|(_, attempt)| attempt).filter(|attempt| attempt.outcome == Outcome::Fix);
    let errors: Vec<f64> = fixes.filter_map(|attempt| attempt.get(Field::Position)).collect();
    let trajectory = proportion::is_trajectory(&trial.header);
    let interval = limits.and_then(|of| rms::over_fixes(of.position[0], of.count, trajectory, &errors));
    let values = [limits.map(|of| of.position[0]), interval.map(|ends| ends.0), interval.map(|ends| ends.1)];
    let names = ["ratio", "ratio-low", "ratio-high"];
    let number = |place: usize| {
        let ratio = values[place].zip(limits).map(|(rms, limits)| rms / limits.position[1]);
        let key = Key::of(trial, "/metrics/totals", format!("{} position_error of judged", names[place]));
        Number::new(ratio, decimals(values[0], limits.map(|of| of.position[1])), key)
    };
    Measured::new(std::array::from_fn(number), "")
}

/// Three decimals near the bound, one from ten times the bound on.
fn decimals(rms: Option<f64>, bound: Option<f64>) -> usize {
    if rms.zip(bound).is_some_and(|(rms, bound)| rms >= 10.0 * bound) { 1 } else { 3 }
}
