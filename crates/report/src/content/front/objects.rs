//! The answer about displaced objects and their neighbours.

use super::measured::{capitalised, wrong};
use crate::{
    content::{
        conditions::labels::Labels,
        sections::objects::{self, GROUPS},
    },
    document::{Text, text},
    field::Field,
    number::Number,
    run::{Run, Trial},
    summary::RunSummary,
};

/// The fixes on the displaced objects in the last and the first trial, and the errors on the others.
pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels) -> Option<Text> {
    let (first, last) = (run.trials.first()?, run.trials.last()?);
    let moved = displaced(last);
    let name = |index: usize| labels.of_trial(&summary.rows[index]);
    let (here, there) = (name(summary.rows.len() - 1), name(0));
    let mut message = Text::new();
    for object in &moved {
        let [attempted, found, ..] = GROUPS.map(|group| objects::count(last, object, group));
        let [before, had, ..] = GROUPS.map(|group| objects::count(first, object, group));
        message.extend(text![
            if message.is_empty() {
                format!("at {here} the displaced {object} has ")
            } else {
                format!("; {object} has ")
            },
            found,
            " fixes in ",
            attempted,
            format!(" attempts, at {there} "),
            had,
            " in ",
            before
        ]);
    }
    if message.is_empty() {
        return None;
    }
    if let (Some(now), Some(then)) = (worst_neighbour(last, &moved), worst_neighbour(first, &moved)) {
        message.extend(text![
            "; the largest median position error of another object is ",
            now,
            format!(" mm at {here} and "),
            then,
            format!(" mm at {there}")
        ]);
    }
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// The names of the objects that the simulation displaced.
fn displaced(trial: &Trial) -> Vec<String> {
    let configuration: toml::Table = trial.header.configuration.parse().unwrap_or_default();
    let objects = configuration.get("source").and_then(|source| source.get("changes")?.get("objects"));
    let names = objects.and_then(toml::Value::as_array).into_iter().flatten();
    names.filter_map(|name| name.as_str().map(str::to_owned)).collect()
}

/// The largest median position error among the objects that were not displaced.
fn worst_neighbour(trial: &Trial, moved: &[String]) -> Option<Number> {
    let others = objects::objects(trial).into_iter().filter(|object| !moved.contains(object));
    let errors = others.map(|object| objects::error(trial, &object, "median", Field::Position));
    errors.filter(|error| error.value.is_some()).max_by(|a, b| {
        let value = |number: &Number| number.value.unwrap_or(f64::NEG_INFINITY);
        value(a).total_cmp(&value(b))
    })
}
