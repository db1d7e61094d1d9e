//! The values of the terms of written answers: those of the tables, with the same keys.

use std::sync::Arc;

use super::trials::Chosen;
use crate::{
    answer::{AnswerError, Extreme, Group, Quantity, Term},
    content::{
        figures::tolerance::Identified,
        front::{
            limits,
            measured::{Measured, Sample, counted_median, median_with},
        },
        phrases::{self, Unit},
        sections::{inspection, navigation, objects},
    },
    field::Field,
    number::{Key, Number},
    run::{Run, Trial},
    summary::RunSummary,
};

/// The values of a run.
#[derive(Clone, Copy)]
pub(super) struct Values<'a> {
    pub(super) run: &'a Run,
    pub(super) summary: &'a RunSummary,
}

impl Values<'_> {
    /// The value of a term in the query `place`.
    pub(super) fn term(&self, term: &Term, place: &str) -> Result<Measured, AnswerError> {
        let chosen = Chosen::of(self.summary, &term.selection, place)?;
        let Some(extreme) = term.extreme else { return self.of(term.quantity, &chosen, place) };
        let mut all = Vec::new();
        for single in chosen.singles(self.run) {
            // A trial without a fix has no error, and is no extreme.
            match self.of(term.quantity, &single, place) {
                Err(error) if error.what != NO_VALUE => return Err(error),
                found => all.extend(found.ok().map(|value| (value, single.is_partial()))),
            }
        }
        let by = |a: &(Measured, bool), b: &(Measured, bool)| a.0.value().total_cmp(&b.0.value());
        let (name, found) = match extreme {
            Extreme::Smallest => ("smallest-of", all.into_iter().min_by(by)),
            Extreme::Largest => ("largest-of", all.into_iter().max_by(by)),
        };
        let (found, is_partial) = found.ok_or_else(|| without(place))?;
        if is_partial {
            // The key names the object or the point.
            return Ok(found);
        }
        let number = found.number();
        let trials: Vec<&Trial> = chosen.members.iter().map(|&index| &self.run.trials[index]).collect();
        let key = phrases::over(&trials, &number.key.topic, format!("{name} {}", number.key.what));
        Ok(found.with_number(Number { key: Arc::new(key), ..number }))
    }

    /// The value of a quantity of the chosen trials.
    pub(super) fn of(&self, quantity: Quantity, chosen: &Chosen, place: &str) -> Result<Measured, AnswerError> {
        let part = match quantity {
            Quantity::Count(Group::Frames) | Quantity::FrameRate => chosen.several.is_some(),
            Quantity::Count(_) | Quantity::Rate(Group::Fixes) => chosen.objects.is_some(),
            Quantity::Median(Field::Position | Field::Tre) => chosen.objects.is_some(),
            Quantity::Navigated(..) => chosen.from.is_some(),
            Quantity::Point(_) => chosen.points.is_some(),
            _ => false,
        };
        if chosen.is_partial() && !part {
            let what = format!("no value of `{}` for this part of a trial", quantity.name());
            return Err(AnswerError::new(place, what, "see docs/answers.md for the parts of each quantity"));
        }
        if let (Quantity::Count(group), false) = (quantity, part) {
            return Ok(self.count(group, &chosen.members));
        }
        if let (Quantity::Rate(group), false) = (quantity, part) {
            let sample = Sample::of(self.run, self.summary, &chosen.members);
            let rate = if group == Group::Wrong { sample.wrong_rate() } else { sample.measured() };
            return known(rate, place);
        }
        let [index] = chosen.members[..] else {
            let what = format!("{} trials match, but `{}` is a value of one", chosen.members.len(), quantity.name());
            return Err(AnswerError::new(place, what, "choose one trial, or begin with `smallest` or `largest`"));
        };
        if [&chosen.objects, &chosen.points].into_iter().flatten().any(|names| names.len() != 1) {
            let what = format!("several parts match, but `{}` is a value of one", quantity.name());
            return Err(AnswerError::new(
                place,
                what,
                "choose one object or point, or begin with `smallest` or `largest`",
            ));
        }
        self.single(quantity, index, chosen).map_or_else(|| Err(without(place)), |value| known(value, place))
    }

    fn count(&self, group: Group, members: &[usize]) -> Measured {
        let rows = members.iter().map(|&index| &self.summary.rows[index]);
        let n = rows.map(|row| match group {
            Group::Attempts => row.attempted,
            Group::Fixes => row.found,
            Group::Wrong => row.wrong,
            Group::Rejected => row.rejected,
            Group::Frames => row.frames,
        });
        let trials: Vec<&Trial> = members.iter().map(|&index| &self.run.trials[index]).collect();
        Measured::single(phrases::pooled_count(&trials, group.key(), n.sum()), "")
    }

    /// The value of a quantity of one trial; `None` where it is undefined.
    fn single(&self, quantity: Quantity, index: usize, chosen: &Chosen) -> Option<Measured> {
        let (trial, row) = (&self.run.trials[index], &self.summary.rows[index]);
        let [object, point] = [&chosen.objects, &chosen.points].map(|names| match names.as_deref() {
            Some([name]) => Some(name.as_str()),
            _ => None,
        });
        Some(match quantity {
            Quantity::Count(Group::Frames) => Measured::single(objects::fixed_in_company(trial, chosen.several?).1, ""),
            Quantity::FrameRate => Measured::new(objects::fixed_in_company(trial, chosen.several?).0, " %"),
            Quantity::Count(group) => {
                let counted = objects::GROUPS.into_iter().find(|(name, _)| *name == group.key())?;
                Measured::single(objects::count(trial, object?, counted), "")
            }
            Quantity::Rate(_) => Measured::new(objects::rate(trial, object?), " %"),
            Quantity::Median(field) => match object {
                Some(object) => Measured::new(objects::median(trial, object, field), " mm"),
                None => self.median(trial, field),
            },
            Quantity::Rms(field) => rms(trial, field, limits::rms(row, field)?),
            Quantity::BoundRatio(field) => limits::ratio(trial, row, field)?,
            Quantity::Navigated("rms", of) => Measured::new(navigation::rms(trial, of, span(trial, chosen)?), " mm"),
            Quantity::Navigated(name, of) => {
                let value = navigation::statistic_over(trial, span(trial, chosen)?, name, of, Unit::Millimetres);
                Measured::single(value, " mm")
            }
            Quantity::Point(_) => Measured::new(inspection::median(trial, point?), " mm"),
            Quantity::Drift(place) => {
                let drifts = navigation::drift_per_metre(trial)?;
                Measured::single(drifts[place].clone(), if place < 3 { " mm/m" } else { "" })
            }
            Quantity::Identified(name) => identified(trial, name)?,
        })
    }

    /// The median of a quantity over the fixes; of the effort of a search, over all attempts.
    fn median(&self, trial: &Trial, field: Field) -> Measured {
        if matches!(field, Field::Tests | Field::Candidates) {
            return counted_median(trial, field);
        }
        let (unit, suffix) = unit(field);
        median_with(trial, field, (unit, self.digits(field)), suffix)
    }

    /// The number of decimals of the medians of a quantity, from those of all trials, as in the tables.
    pub(super) fn digits(&self, field: Field) -> usize {
        let found = |trial: &Trial| -> Option<f64> {
            let fixes = trial.attempts().filter(|(_, row)| row.found());
            let mut values: Vec<f64> = fixes.filter_map(|(_, row)| row.get(field)).collect();
            (!values.is_empty()).then(|| seafix_evaluation::quantile(&mut values, 0.5))
        };
        phrases::decimals(self.run.trials.iter().map(found), unit(field).0)
    }
}

/// The unit in which a quantity is printed, and its sign.
pub(super) fn unit(field: Field) -> (Unit, &'static str) {
    match field.unit() {
        "m" => (Unit::Millimetres, " mm"),
        "rad" => (Unit::Degrees, " deg"),
        "px" => (Unit::Plain, " px"),
        "ms" => (Unit::Plain, " ms"),
        _ => (Unit::Plain, ""),
    }
}

/// The root mean square of an error over all fixes (mm).
fn rms(trial: &Trial, field: Field, value: f64) -> Measured {
    let what = format!("rms {} of judged{}", field.name(), Unit::Millimetres.suffix());
    let millimetres = value * Unit::Millimetres.scale();
    let digits = crate::format::decimals([millimetres]);
    Measured::single(Number::new(Some(millimetres), digits, Key::of(trial, "/metrics/totals", what)), " mm")
}

/// A measure of the identified points: precision, recall or F1.
fn identified(trial: &Trial, name: &str) -> Option<Measured> {
    let found = Identified::of(trial)?;
    let (value, what) = match name {
        "precision" => (found.precision, "sum correct_pairs by identified of fixes"),
        "recall" => (found.recall, "sum correct_pairs by visible"),
        _ => (found.f1(), "f1 of identified"),
    };
    Some(Measured::single(Number::new(Some(value), 3, Key::of(trial, "/metrics/evaluation", what)), ""))
}

/// The stamps from the chosen frame on; `None` without such a frame.
fn span(trial: &Trial, chosen: &Chosen) -> Option<[u64; 2]> {
    let Some(first) = chosen.from else { return Some(trial.span()) };
    let first = trial.sample().find(|frame| frame.number >= first)?;
    Some([first.stamp_ns, trial.span()[1]])
}

/// The description of a missing value.
const NO_VALUE: &str = "no value";

fn without(place: &str) -> AnswerError {
    AnswerError::new(place, NO_VALUE, "choose trials with this quantity: an error needs a fix, a drift two intervals")
}

/// The value, if it is known.
fn known(value: Measured, place: &str) -> Result<Measured, AnswerError> {
    if value.value().is_nan() { Err(without(place)) } else { Ok(value) }
}
