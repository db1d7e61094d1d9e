//! The section on objects: outcomes and errors of each object of a run with several.

use std::collections::BTreeSet;

use crate::{
    content::{
        conditions::columns,
        phrases::{self, Unit},
    },
    document::{Block, Head, Section, Table, Text, text},
    field::Field,
    number::{Key, Number},
    proportion,
    run::{AttemptRow, Frame, Run, Trial},
    summary::RunSummary,
};

/// The topic of the counts.
const TOPIC: &str = "/metrics/evaluation";

/// A counted outcome: its name in keys and its test.
pub(crate) type Group = (&'static str, fn(&AttemptRow) -> bool);

/// The counted outcomes: attempts, fixes, rejections and wrong fixes.
pub(crate) const GROUPS: [Group; 4] = [
    ("attempted", |_| true),
    ("found", AttemptRow::found),
    ("refused", |row| !row.found() && !row.wrong()),
    ("wrong", AttemptRow::wrong),
];

/// The reported errors with their table heads.
const ERRORS: [(&str, Field); 2] = [("TRE (mm)", Field::Tre), ("position error (mm)", Field::Position)];

/// The section; `None` where no trial with a complete log searched several objects.
pub(crate) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    if !run.trials.iter().any(|trial| objects(trial).len() > 1) {
        return None;
    }
    let caption = text!["Attempts on each object by outcome, and the errors of the fixes."];
    let mut above = columns::blank(summary, 5);
    above.extend(ERRORS.map(|(head, _)| Head::over(2, head)));
    let mut below = columns::heads(summary);
    below.push(Head::words("object"));
    below.extend(GROUPS.map(|(name, _)| Head::numbers(phrases::outcome(name))));
    below.extend(ERRORS.iter().flat_map(|_| ["median", "p95"]).map(Head::numbers));
    let mut table = Table { id: "objects".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        for (place, object) in objects(trial).iter().enumerate() {
            let mut line = columns::cells(row);
            line.push(object.clone().into());
            line.extend(GROUPS.map(|group| count(trial, object, group).into()));
            for (_, field) in ERRORS {
                line.extend(["median", "q95"].map(|name| error(trial, object, name, field).into()));
            }
            table.line(place == 0 && columns::breaks(summary, index), line);
        }
    }
    Some(Section::new("Objects").with([Block::Table(table)]))
}

/// One sentence for every trial with the fixes and errors of each object.
///
/// Only experiments that change the objects have them; they show whether a displaced object affects the fixes on
/// others. `name` gives the name of the trial at an index.
pub(crate) fn sentences(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let trials = run.trials.iter().enumerate().filter(|(_, trial)| moves(trial) && objects(trial).len() > 1);
    let sentence = |(index, trial): (usize, &Trial)| {
        let mut message = text![format!("{}, by object — ", name(index))];
        for (place, object) in objects(trial).iter().enumerate() {
            let [attempted, found, _, _] = GROUPS.map(|group| count(trial, object, group));
            let median = error(trial, object, "median", Field::Position);
            message.extend(text![format!("{}{object}: ", if place > 0 { "; " } else { "" }), found, " fixes in "]);
            message.extend(text![attempted, " attempts"]);
            if median.value.is_some() {
                message.extend(text![", median position error ", median, " mm"]);
            }
        }
        message.push(".".into());
        message
    };
    trials.map(sentence).collect()
}

/// Whether the experiment of a trial changes objects.
pub(crate) fn moves(trial: &Trial) -> bool {
    trial.header.axes.iter().any(|axis| axis.key.starts_with("source.changes"))
}

/// A sentence on the frames with a fix, by the number of targets in view.
///
/// The result is `None` where no frame has several.
///
/// `name` gives the name of the trial at an index.
pub(crate) fn company(run: &Run, name: &dyn Fn(usize) -> String) -> Option<Text> {
    let sizes = |trial: &Trial| -> Vec<usize> {
        let mut sizes: Vec<usize> = trial.sample().map(|frame| trial.attempts_of(frame).count()).collect();
        sizes.sort_unstable();
        sizes.dedup();
        sizes.into_iter().filter(|size| *size > 0).collect()
    };
    if !run.trials.iter().any(|trial| sizes(trial).into_iter().any(|size| size > 1)) {
        return None;
    }
    let mut message = text!["Frames with a fix, by the number of targets in view — "];
    for (index, trial) in run.trials.iter().enumerate() {
        message.push(format!("{}{}: ", if index > 0 { "; " } else { "" }, name(index)).into());
        for (place, size) in sizes(trial).into_iter().enumerate() {
            let own = || trial.sample().filter(|frame| trial.attempts_of(frame).count() == size);
            let fixed = own().filter(|frame| trial.attempts_of(frame).any(AttemptRow::found)).count();
            let key = |which: &str| Key::of(trial, TOPIC, format!("count {which} with {size} targets"));
            let (fixed, all) = (Number::count(fixed, key("fixed-frames")), Number::count(own().count(), key("frames")));
            message.extend(text![
                if place > 0 { ", " } else { "" },
                fixed,
                " of ",
                all,
                format!(" with {size} in view")
            ]);
        }
    }
    message.push(".".into());
    Some(message)
}

/// The frames with attempts on several objects, or on one.
pub(crate) fn in_company(trial: &Trial, several: bool) -> impl Iterator<Item = &Frame> {
    let matches = move |size: usize| if several { size > 1 } else { size == 1 };
    trial.sample().filter(move |frame| matches(trial.attempts_of(frame).count()))
}

/// The fraction of frames with a fix among those [`in_company`] (%), the ends of its interval, and their number.
pub(crate) fn fixed_in_company(trial: &Trial, several: bool) -> ([Number; 3], Number) {
    let events: Vec<bool> =
        in_company(trial, several).map(|frame| trial.attempts_of(frame).any(AttemptRow::found)).collect();
    let group = if several { "several targets" } else { "one target" };
    let key = |what: &str| Key::of(trial, TOPIC, format!("{what} with {group}"));
    let rate = with_interval(trial, &events, |what| key(&format!("{what} fixed-frames")));
    (rate, Number::count(events.len(), key("count frames")))
}

/// The fraction of events (%), and the ends of its 95 % interval.
fn with_interval(trial: &Trial, events: &[bool], key: impl Fn(&str) -> Key) -> [Number; 3] {
    let rate = proportion::rate(proportion::is_trajectory(&trial.header), events);
    let number = |(place, what): (usize, &str)| Number::new(rate.map(|rate| rate[place]), 1, key(what));
    [(0, "percent"), (1, "low"), (2, "high")].map(number)
}

/// The fraction of fixes among the attempts on an object (%), and the ends of its 95 % interval.
pub(crate) fn rate(trial: &Trial, object: &str) -> [Number; 3] {
    let events: Vec<bool> = own(trial, object).map(AttemptRow::found).collect();
    with_interval(trial, &events, |what| Key::of(trial, TOPIC, format!("{what} found on the object {object}")))
}

/// The median of an error of the fixes on an object (mm), and the ends of its 95 % interval.
pub(crate) fn median(trial: &Trial, object: &str, field: Field) -> [Number; 3] {
    let mut values: Vec<f64> = own(trial, object).filter(|row| row.found()).filter_map(|row| row.get(field)).collect();
    let interval = proportion::median_interval(proportion::is_trajectory(&trial.header), &mut values);
    let end = |name: &str, value: Option<f64>| {
        let what = format!("{name} {} of found on the object {object} in mm", field.name());
        Number::new(value.map(|value| value * Unit::Millimetres.scale()), 1, Key::of(trial, field.topic(), what))
    };
    let ends = interval.map_or([None; 2], |(low, high)| [Some(low), Some(high)]);
    [error(trial, object, "median", field), end("median-low", ends[0]), end("median-high", ends[1])]
}

/// The searched objects by name.
///
/// The result is empty for a decimated log, and for generated problems, whose attempts each have an object of their
/// own.
pub(crate) fn objects(trial: &Trial) -> Vec<String> {
    let names: BTreeSet<&str> = trial.attempts().map(|(_, row)| trial.object(row)).collect();
    if trial.every() > 1 || 2 * names.len() > trial.attempts().count() {
        return Vec::new();
    }
    let mut names: Vec<String> = names.into_iter().map(str::to_owned).collect();
    names.sort();
    names
}

fn own<'a>(trial: &'a Trial, object: &'a str) -> impl Iterator<Item = &'a AttemptRow> {
    trial.attempts().map(|(_, row)| row).filter(move |row| trial.object(row) == object)
}

/// The number of attempts of a group on an object.
pub(crate) fn count(trial: &Trial, object: &str, (name, is): Group) -> Number {
    let key = Key::of(trial, TOPIC, format!("count {name} on the object {object}"));
    Number::count(own(trial, object).filter(|row| is(row)).count(), key)
}

/// The median or the 95 % quantile of an error of the fixes on an object (mm).
pub(crate) fn error(trial: &Trial, object: &str, name: &str, field: Field) -> Number {
    let mut values: Vec<f64> = own(trial, object).filter(|row| row.found()).filter_map(|row| row.get(field)).collect();
    let fraction = if name == "median" { 0.5 } else { 0.95 };
    let value = (!values.is_empty()).then(|| seafix_evaluation::quantile(&mut values, fraction));
    let what = format!("{name} {} of found on the object {object} in mm", field.name());
    Number::new(value.map(|value| value * Unit::Millimetres.scale()), 1, Key::of(trial, field.topic(), what))
}
