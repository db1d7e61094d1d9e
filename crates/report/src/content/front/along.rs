//! The answer along a numeric axis: rates or errors at both ends, or the value up to which fixes succeed.

use super::{
    company,
    contrast::Contrast,
    kind::Asked,
    measured::{Sample, capitalised, error, median_of, wrong},
};
use crate::{
    content::{
        conditions::{axes, labels::Labels},
        phrases::{self, Unit},
    },
    document::{Text, text},
    run::Run,
    summary::RunSummary,
};

/// Maximum number of series that a sentence lists; of more it has the best and the worst.
const LISTED: usize = 3;
/// The rate of fixes (%) that counts as success of a condition: every second attempt.
const HALF: f64 = 0.5;

pub(super) fn sentence(run: &Run, summary: &RunSummary, labels: &Labels, key: &str, asked: Asked) -> Option<Text> {
    let place = |index: usize| place(summary, key, index);
    let mut series: Vec<(String, Vec<usize>)> = labels.series(summary);
    for (_, members) in &mut series {
        members.retain(|&index| summary.rows[index].attempted > 0);
        members.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
    }
    series.retain(|(_, members)| !members.is_empty());
    let named = series.len() > 1;
    let (_, _, of) = error(summary);
    let known = |place: f64, members: &[usize]| {
        members.iter().any(|&index| self::place(summary, key, index) == place && of(&summary.rows[index]).is_some())
    };
    // Errors of several series are stated at the same places, so that they can be compared.
    let mut common: Vec<f64> = series.iter().flat_map(|(_, members)| members).map(|&index| place(index)).collect();
    common.sort_by(f64::total_cmp);
    common.dedup();
    let everywhere = common.clone();
    common.retain(|&place| series.iter().all(|(_, members)| known(place, members)));
    let common = if common.is_empty() { everywhere } else { common };
    let mut message = Text::new();
    for (name, members) in chosen(run, summary, series) {
        let mut clauses = Vec::new();
        let one = Series { run, summary, labels, key, members: &members, effect: asked.effect };
        if asked.rate {
            clauses.push(if asked.threshold { one.threshold() } else { one.rates() });
        }
        if asked.accuracy {
            clauses.extend(one.errors(&common));
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
    if asked.company {
        message.extend(company::clause(run, summary, labels));
    }
    message.extend(wrong(run, summary));
    Some(capitalised(message))
}

/// The value of a trial on the axis.
fn place(summary: &RunSummary, key: &str, index: usize) -> f64 {
    axes::on(&summary.rows[index], key).unwrap_or(f64::INFINITY)
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
    /// Whether the ends are compared.
    effect: bool,
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
        if let [first, last] = Self::ends(self.members)[..] {
            let contrast = Contrast { run: self.run, summary: self.summary };
            message.extend(self.effect.then(|| contrast.change_of_rate(first, last)).flatten().unwrap_or_default());
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
        message.extend(self.surely(count));
        message
    }

    /// The words on the values, of the first `count`, whose interval is above one half as a whole; `None` if all are.
    fn surely(&self, count: usize) -> Option<crate::document::Span> {
        let sure =
            |index: &&usize| self.sample(**index).measured().interval().is_some_and(|[low, _]| low >= 100.0 * HALF);
        let own: Vec<String> = self.members[..count].iter().filter(sure).map(|&index| self.at(index)).collect();
        let first = self.members[..count].iter().take_while(sure).count();
        (own.len() < count).then(|| match own.last() {
            None => ", with no interval above one half as a whole".into(),
            Some(last) if first == own.len() => {
                format!(", with intervals above one half as a whole up to {last}").into()
            }
            Some(_) => {
                let own = own.iter().map(String::as_str);
                format!(", with intervals above one half as a whole only at {}", own.collect::<Vec<_>>().join(" and "))
                    .into()
            }
        })
    }

    /// The median errors at both ends of the `common` places with fixes, and the places without any; `None` without fixes.
    fn errors(&self, common: &[f64]) -> Option<Text> {
        let (name, field, of) = error(self.summary);
        let (known, unknown): (Vec<usize>, Vec<usize>) =
            self.members.iter().partition(|&&index| of(&self.summary.rows[index]).is_some());
        let place = |index: usize| place(self.summary, self.key, index);
        let shared: Vec<usize> = known.iter().copied().filter(|&index| common.contains(&place(index))).collect();
        let measured =
            |index: usize| median_of(self.summary, &self.run.trials[index], (field, of), (Unit::Millimetres, " mm"));
        let mut ends = Self::ends(if shared.is_empty() { &known } else { &shared });
        // A series that reaches farther than the others has its own end as well.
        ends.extend(known.last().copied().filter(|last| !ends.contains(last)));
        let mut message = text![format!("the median {name} is ")];
        for (order, &index) in ends.iter().enumerate() {
            message.push(
                match order {
                    0 => "",
                    _ if order + 1 == ends.len() => " and ",
                    _ => ", ",
                }
                .into(),
            );
            message.extend(measured(index).text());
            message.push(format!(" at {}", self.at(index)).into());
        }
        if let [first, last] = ends[..] {
            let contrast = Contrast { run: self.run, summary: self.summary };
            let digits =
                phrases::decimals(self.summary.rows.iter().map(|row| of(row).map(|s| s.median)), Unit::Millimetres);
            let change = self.effect.then(|| contrast.change_of_value(field, first, last, digits)).flatten();
            message.extend(change.unwrap_or_default());
        }
        if !unknown.is_empty() {
            let places: Vec<String> = unknown.iter().map(|&index| self.at(index)).collect();
            message.push(format!(", with no fix at {}", places.join(" and ")).into());
        }
        (!known.is_empty()).then_some(message)
    }
}
