//! The answer about displaced objects and their neighbours.

use super::measured::{Measured, capitalised, wrong};
use crate::{
    content::{
        conditions::labels::Labels,
        sections::objects::{self, GROUPS},
    },
    document::{Text, text},
    field::Field,
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
        let [now, before] = [last, first].map(|trial| Measured::new(objects::rate(trial, object), " %"));
        let attempts = |trial| objects::count(trial, object, GROUPS[0]);
        let answer = match (now.value() > 0.0, now.differs(&before) && now.value() < before.value()) {
            (false, _) => "no fix",
            (true, true) => "fixes, but fewer than in its place",
            (true, false) => "fixes, not shown to be fewer than in its place",
        };
        let begin = match (message.is_empty(), now.value() > 0.0) {
            (true, true) => "yes, ",
            (true, false) => "no, ",
            (false, _) => "; ",
        };
        message.push(format!("{begin}the displaced {object} gets {answer}: at {here} in ").into());
        message.extend(now.text());
        message.extend(text![" of ", attempts(last), format!(" attempts, at {there} in ")]);
        message.extend(before.text());
        message.extend(text![" of ", attempts(first)]);
    }
    if message.is_empty() {
        return None;
    }
    if let (Some(now), Some(then)) = (worst_neighbour(last, &moved), worst_neighbour(first, &moved)) {
        let misled = now.differs(&then) && now.value() > then.value();
        let answer =
            if misled { "its neighbours are less accurate" } else { "that it misleads its neighbours is not shown" };
        message.push(format!("; {answer}: their largest median position error is ").into());
        message.extend(now.text());
        message.push(format!(" at {here} and ").into());
        message.extend(then.text());
        message.push(format!(" at {there}").into());
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
fn worst_neighbour(trial: &Trial, moved: &[String]) -> Option<Measured> {
    let others = objects::objects(trial).into_iter().filter(|object| !moved.contains(object));
    let errors = others.map(|object| Measured::new(objects::median(trial, &object, Field::Position), " mm"));
    errors.filter(|error| error.value().is_finite()).max_by(|a, b| a.value().total_cmp(&b.value()))
}
