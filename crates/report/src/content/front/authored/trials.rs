//! The trials that a selection of a written answer means.

use seafix_component::{nearest, unknown};

use crate::{
    answer::{AnswerError, Condition, Selection},
    content::{
        conditions::labels::value,
        sections::{inspection, objects},
    },
    format::{distinct, short},
    run::Run,
    summary::RunSummary,
};

/// The trials of a selection, and the part of them that it names.
#[derive(Debug, Clone, Default)]
pub(super) struct Chosen {
    /// The indices of the trials, in the order of the run; never empty.
    pub(super) members: Vec<usize>,
    /// The objects whose attempts count; any of them for an empty list.
    pub(super) objects: Option<Vec<String>>,
    /// The points of interest; any of them for an empty list.
    pub(super) points: Option<Vec<String>>,
    /// The number of the first frame that counts.
    pub(super) from: Option<u64>,
    /// Whether frames with several targets in view count, or those with one.
    pub(super) several: Option<bool>,
}

/// The conditions on a part of a trial.
const PARTS: [&str; 4] = ["object", "point", "from", "in-view"];

impl Chosen {
    /// The trials of a selection in the query `place`.
    ///
    /// Every axis on which they differ must be named, so that no two trials are mixed unintendedly.
    pub(super) fn of(summary: &RunSummary, selection: &Selection, place: &str) -> Result<Self, AnswerError> {
        let keys: Vec<&str> =
            summary.rows.first().map_or_else(Vec::new, |row| row.axes.iter().map(|axis| axis.key.as_str()).collect());
        let mut chosen = Self { members: (0..summary.rows.len()).collect(), ..Self::default() };
        let mut named = Vec::new();
        for condition in &selection.conditions {
            match keys.iter().find(|key| short(key) == condition.key || **key == condition.key) {
                Some(key) => {
                    named.push(*key);
                    chosen.keep(summary, key, condition, place)?;
                }
                None => chosen.part(condition, &keys, place)?,
            }
        }
        if chosen.members.is_empty() {
            let trials: Vec<String> = summary.rows.iter().map(|row| row.trial.clone()).collect();
            let what = format!("no trial matches `{}`", selection.text);
            return Err(AnswerError::new(place, what, format!("there are {}", trials.join(", "))));
        }
        let values = |key: &str| distinct(chosen.members.iter().map(|&index| value(&summary.rows[index], key)));
        let open = keys.iter().find(|key| !named.contains(key) && values(key).len() > 1);
        match open.filter(|_| selection.text != "all") {
            None => Ok(chosen),
            Some(key) => {
                let what = format!("several trials match `{}`", selection.text);
                let remedy = format!("add {0}={1}, or {0}=any", short(key), values(key).join("|"));
                Err(AnswerError::new(place, what, remedy))
            }
        }
    }

    /// Keeps the trials with one of the values of a condition.
    fn keep(&mut self, summary: &RunSummary, key: &str, condition: &Condition, place: &str) -> Result<(), AnswerError> {
        let known = distinct(summary.rows.iter().map(|row| value(row, key)));
        for wanted in &condition.values {
            if !known.iter().any(|known| same(known, wanted)) {
                let remedy = match nearest(wanted, known.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("there are {}", known.join(", ")),
                };
                return Err(AnswerError::new(place, format!("no trial has {}=`{wanted}`", condition.key), remedy));
            }
        }
        let has = |index: &usize| {
            let own = value(&summary.rows[*index], key);
            condition.values.is_empty() || condition.values.iter().any(|wanted| same(&own, wanted))
        };
        self.members.retain(has);
        Ok(())
    }

    /// Takes a condition on a part of the trials.
    fn part(&mut self, condition: &Condition, keys: &[&str], place: &str) -> Result<(), AnswerError> {
        let faulty = |what: String, remedy: &str| Err(AnswerError::new(place, what, remedy));
        let name = condition.key.as_str();
        if !PARTS.contains(&name) {
            let known: Vec<&str> = keys.iter().map(|key| short(key)).chain(PARTS).collect();
            let remedy = unknown(name, &known);
            return faulty(format!("no axis `{name}`"), remedy.trim_start_matches([',', ';', ' ']));
        }
        match name {
            "object" => self.objects = Some(condition.values.clone()),
            "point" => self.points = Some(condition.values.clone()),
            _ => {}
        }
        if matches!(name, "object" | "point") {
            return Ok(());
        }
        let [value] = &condition.values[..] else {
            return faulty(format!("not one value of `{name}`"), "name one");
        };
        match name {
            "from" => match value.parse() {
                Ok(frame) => self.from = Some(frame),
                Err(_) => return faulty(format!("no frame `{value}`"), "give the number of a frame"),
            },
            _ => match value.as_str() {
                "one" => self.several = Some(false),
                "several" => self.several = Some(true),
                _ => return faulty(format!("unknown in-view `{value}`"), "write in-view=one or in-view=several"),
            },
        }
        Ok(())
    }

    /// The same for each single trial and each single object or point of it.
    pub(super) fn singles(&self, run: &Run) -> Vec<Self> {
        let each = |of: &Option<Vec<String>>, known: Vec<String>| match of {
            None => vec![None],
            Some(names) if names.is_empty() => known.into_iter().map(|name| Some(vec![name])).collect(),
            Some(names) => names.iter().map(|name| Some(vec![name.clone()])).collect(),
        };
        let mut singles = Vec::new();
        for &index in &self.members {
            let trial = &run.trials[index];
            for objects in each(&self.objects, objects::objects(trial)) {
                for points in each(&self.points, inspection::points(trial)) {
                    singles.push(Self { members: vec![index], objects: objects.clone(), points, ..self.clone() });
                }
            }
        }
        singles
    }

    /// Whether the selection names a part of the trials.
    pub(super) fn is_partial(&self) -> bool {
        self.objects.is_some() || self.points.is_some() || self.from.is_some() || self.several.is_some()
    }
}

/// Whether two values of an axis are equal, as texts or as numbers.
fn same(a: &str, b: &str) -> bool {
    a == b || matches!((a.parse::<f64>(), b.parse::<f64>()), (Ok(a), Ok(b)) if a == b)
}
