//! The answer along a numeric axis: rates or errors at both ends, or the value up to which fixes succeed.

use super::{
    kind::Asked,
    measured::{Sample, capitalised, error, median, wrong},
};
use crate::{
    content::conditions::{axes, labels::Labels},
    document::{Text, text},
    run::Run,
    summary::RunSummary,
};

/// Maximum number of series that a sentence lists; of more it has the best and the worst.
const LISTED: usize = 3;
/// The rate of fixes (%) that counts as success of a condition: every second attempt.
const HALF: f64 = 0.5;

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, key: &str, asked: Asked) -> Option<Text> {
    let place = |index: usize| axes::on(&summary.rows[index], key).unwrap_or(f64::INFINITY);
    let mut series: Vec<(String, Vec<usize>)> = labels.series(summary);
    for (_, members) in &mut series {
        members.retain(|&index| summary.rows[index].attempted > 0);
        members.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
    }
    series.retain(|(_, members)| !members.is_empty());
    let named = series.len() > 1;
    let mut message = Text::new();
    for (name, members) in chosen(run, summary, series) {
        let mut clauses = Vec::new();
        let one = Series { run, summary, labels, key, members: &members };
        if asked.rate {
            clauses.push(if asked.threshold { one.threshold() } else { one.rates() });
        }
        if asked.accuracy {
            clauses.extend(one.errors());
        }
        if clauses.is_empty() {
            continue;
        }
        message.extend(text![if message.is_empty() { "" } else { "; " }]);
        if named {
            message.push(format!("with {name}, ").into());
        }
        for (index, clause) in clauses.into_iter().enumerate() {
            message.push(if index > 0 { ", and ".into() } else { "".into() });
            message.extend(clause);
        }
    }
    message.retain(|span| !span.plain().is_empty());
    if message.is_empty() {
        return None;
    }
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// The series that the sentence lists.
fn chosen(run: &Run, summary: &RunSummary, mut series: Vec<(String, Vec<usize>)>) -> Vec<(String, Vec<usize>)> {
    if series.len() <= LISTED {
        return series;
    }
    let fraction = |members: &Vec<usize>| Sample::of(run, summary, members).fraction();
    series.sort_by(|a, b| fraction(&b.1).total_cmp(&fraction(&a.1)));
    let worst = series.pop();
    series.truncate(1);
    series.extend(worst);
    series
}

/// A series along the axis, in order of its values.
struct Series<'a> {
    run: &'a Run,
    summary: &'a RunSummary,
    labels: &'a Labels,
    key: &'a str,
    members: &'a [usize],
}

impl Series<'_> {
    fn at(&self, index: usize) -> String {
        self.labels.place(&self.summary.rows[index], self.key)
    }

    fn sample(&self, index: usize) -> Sample<'_> {
        Sample::of(self.run, self.summary, &[index])
    }

    /// The first and the last of these members; one of them if there is only one.
    fn ends(members: &[usize]) -> Vec<usize> {
        match members {
            [first, .., last] => vec![*first, *last],
            members => members.to_vec(),
        }
    }

    /// The rates of fixes at both ends.
    fn rates(&self) -> Text {
        let mut message = text!["fixes succeed in "];
        for (place, index) in Self::ends(self.members).into_iter().enumerate() {
            message.push(if place > 0 { " and in ".into() } else { "".into() });
            message.extend(self.sample(index).rate());
            message.push(format!("{} at {}", if place > 0 { "" } else { " of the attempts" }, self.at(index)).into());
        }
        message
    }

    /// The largest value up to which at least half of the attempts have a fix at every value.
    fn threshold(&self) -> Text {
        let succeeds = |index: &&usize| self.sample(**index).fraction() >= HALF;
        let count = self.members.iter().take_while(succeeds).count();
        let mut message = match count.checked_sub(1).map(|last| self.members[last]) {
            Some(last) => {
                let tested = if count == self.members.len() { ", the largest tested" } else { "" };
                let mut message =
                    text![format!("at least half of the attempts succeed up to {}{tested} (", self.at(last))];
                message.extend(self.sample(last).rate());
                message
            }
            None => text!["fewer than half of the attempts succeed everywhere ("],
        };
        let beyond = self.members.get(count).map(|&next| (next, self.at(next)));
        if let Some((next, at)) = beyond {
            message.push(if count > 0 { "; ".into() } else { "".into() });
            message.extend(self.sample(next).rate());
            message.push(format!(" at {at}").into());
        }
        message.push(")".into());
        message
    }

    /// The median errors at both ends of the values with fixes; `None` without fixes.
    fn errors(&self) -> Option<Text> {
        let (name, _, of) = error(self.summary);
        let known: Vec<usize> =
            self.members.iter().copied().filter(|&index| of(&self.summary.rows[index]).is_some()).collect();
        let mut message = text![format!("the median {name} is ")];
        for (place, index) in Self::ends(&known).into_iter().enumerate() {
            message.push(if place > 0 { " and ".into() } else { "".into() });
            message.extend(median(self.summary, &self.run.trials[index]));
            message.push(format!(" at {}", self.at(index)).into());
        }
        (!known.is_empty()).then_some(message)
    }
}
