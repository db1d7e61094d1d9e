//! The answer about solvers beside the Cramér–Rao bound.

use super::measured::{Measured, capitalised};
use crate::{
    document::{Text, text},
    format::distinct,
    number::{Key, Number},
    rms,
    run::{Run, Trial},
    summary::{Limits, Row, RunSummary},
};
use crate::{field::Field, proportion};
use seafix_log::Outcome;

/// The smallest and the largest ratio of RMS error to its bound over all conditions, of the camera position and of the
/// model points (TRE), with every method; the best method first.
pub(super) fn sentence(run: &Run, summary: &RunSummary) -> Option<Text> {
    let ratio = |index: usize| Some(summary.rows[index].limits?.position).map(|[rms, bound]| rms / bound);
    // One search for all solvers is no part of their names.
    let searches = summary.rows.iter().any(|row| row.search != summary.rows[0].search);
    let name = |row: &Row| if searches { row.method() } else { row.solver.clone() };
    let of_method = |method: String| {
        let own: Vec<usize> = (0..summary.rows.len())
            .filter(|&index| name(&summary.rows[index]) == method && ratio(index).is_some())
            .collect();
        let ends = [Quantity::Position, Quantity::Tre].map(|quantity| {
            let mut values: Vec<Measured> =
                own.iter().map(|&index| measured(&run.trials[index], &summary.rows[index], quantity)).collect();
            values.sort_by(|a, b| a.value().total_cmp(&b.value()));
            values
        });
        (!own.is_empty()).then_some((method, ends))
    };
    let methods = distinct(summary.rows.iter().map(name));
    let mut known: Vec<(String, [Vec<Measured>; 2])> = methods.into_iter().filter_map(of_method).collect();
    let largest = |ends: &[Vec<Measured>; 2]| ends[0].last().map_or(f64::INFINITY, Measured::value);
    known.sort_by(|a, b| largest(&a.1).total_cmp(&largest(&b.1)));
    let mut message = Text::new();
    for (place, (method, [position, points])) in known.into_iter().enumerate() {
        message.push(match place {
            0 => {
                format!("in multiples of the Cramér–Rao bound, with {method} the RMS camera position error is ").into()
            }
            _ => format!("; with {method} ").into(),
        });
        message.extend(range(&position));
        message.push(if place == 0 { " and the RMS error of the model points " } else { " and " }.into());
        message.extend(range(&points));
        let meets = |values: &Vec<Measured>| {
            values.iter().all(|value| value.interval().is_some_and(|[low, high]| low <= 1.0 && high >= 1.0))
        };
        message.push(match [meets(&position), meets(&points)] {
            [true, true] => ", neither significantly different from the bound".into(),
            _ => "".into(),
        });
    }
    message.retain(|span| !span.plain().is_empty());
    (!message.is_empty()).then(|| capitalised(message))
}

/// The ratios of a trial: of the camera position error and of the TRE.
pub(super) fn ratios(trial: &Trial, row: &Row) -> Text {
    let [position, points] =
        [Quantity::Position, Quantity::Tre].map(|quantity| measured(trial, row, quantity).number());
    text![position, " / ", points]
}

/// The RMS of an error over all fixes of a trial (m); `None` for another quantity, or without bounds.
pub(super) fn rms(row: &Row, field: Field) -> Option<f64> {
    Some(Quantity::named(field)?.of(row.limits.as_ref()?)[0])
}

/// The RMS of an error over all fixes of a trial in multiples of its bound, with its interval; `None` for another quantity.
pub(super) fn ratio(trial: &Trial, row: &Row, field: Field) -> Option<Measured> {
    Some(measured(trial, row, Quantity::named(field)?))
}

/// The first and the last of sorted values: `0.996 [0.986, 1.005] to 0.998 [0.988, 1.007]`.
fn range(values: &[Measured]) -> Text {
    let mut message = Text::new();
    for (place, value) in values.first().into_iter().chain(values.last().filter(|_| values.len() > 1)).enumerate() {
        message.push(if place > 0 { " to ".into() } else { "".into() });
        message.extend(value.text());
    }
    message
}

/// An error with a bound.
#[derive(Debug, Clone, Copy)]
enum Quantity {
    Position,
    Tre,
}

impl Quantity {
    /// The error with a bound that this quantity is.
    fn named(field: Field) -> Option<Self> {
        [Self::Position, Self::Tre].into_iter().find(|quantity| quantity.field() == field)
    }

    fn field(self) -> Field {
        match self {
            Self::Position => Field::Position,
            Self::Tre => Field::Tre,
        }
    }

    /// The RMS error and its bound.
    fn of(self, limits: &Limits) -> [f64; 2] {
        match self {
            Self::Position => limits.position,
            Self::Tre => limits.tre,
        }
    }
}

/// The ratio of a trial with its 95 % interval.
fn measured(trial: &Trial, row: &Row, quantity: Quantity) -> Measured {
    let limits = row.limits.as_ref().map(|limits| (quantity.of(limits), limits.count));
    let fixes = trial.attempts().map(|(_, attempt)| attempt).filter(|attempt| attempt.outcome == Outcome::Fix);
    let errors: Vec<f64> = fixes.filter_map(|attempt| attempt.get(quantity.field())).collect();
    let trajectory = proportion::is_trajectory(&trial.header);
    let interval = limits.and_then(|([rms, _], count)| rms::over_fixes(rms, count, trajectory, &errors));
    let values = [limits.map(|([rms, _], _)| rms), interval.map(|ends| ends.0), interval.map(|ends| ends.1)];
    let names = ["ratio", "ratio-low", "ratio-high"];
    let number = |place: usize| {
        let ratio = values[place].zip(limits).map(|(rms, ([_, bound], _))| rms / bound);
        let key = Key::of(trial, "/metrics/totals", format!("{} {} of judged", names[place], quantity.field().name()));
        Number::new(ratio, decimals(values[0], limits.map(|([_, bound], _)| bound)), key)
    };
    Measured::new(std::array::from_fn(number), "")
}

/// Three decimals near the bound, one from ten times the bound on.
fn decimals(rms: Option<f64>, bound: Option<f64>) -> usize {
    if rms.zip(bound).is_some_and(|(rms, bound)| rms >= 10.0 * bound) { 1 } else { 3 }
}
