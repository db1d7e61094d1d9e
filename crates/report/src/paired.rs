//! Which of two trials errs less, on the same frames.

use std::collections::BTreeMap;

use seafix_evaluation::{Bootstrap, holm, mcnemar, median, signed_rank};
use seafix_log::Axis;

use crate::{
    Field, RunSummary,
    content::distinct,
    format,
    run::{Run, Trial},
};

/// Of the resamples: any number, but the same for everyone.
pub(crate) const SEED: u64 = 20_211_038;
/// Claims in a family are wrong with at most this chance.
pub(crate) const ALPHA: f64 = 0.05;
/// Two that are not significantly different are called equivalent where the 90 % interval of the median difference of m2 is
/// within this margin (m); set beforehand.
pub(crate) const MARGIN: f64 = 1e-3;
/// The same of a ratio of medians over conditions.
pub(crate) const MARGIN_RATIO: f64 = 1.1;
/// Of fewer independent differences the median is outside all of them with a probability of more than a tenth: 2 · 2⁻⁴.
const MIN_BLOCKS: usize = 5;
/// So many in a group are all compared with each other; of more each with the first alone.
pub(crate) const ALL_PAIRS: usize = 8;
/// More comparisons than these nobody reads; then only groups of four or less are compared in all pairs.
const READABLE: usize = 40;
/// From so many conditions on they are the units, one value each, not the frames.
const CONDITIONS: usize = 10;

/// Two trials, or two methods over many conditions, compared by m2, failures as infinitely far off.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// What both have in common; empty over conditions.
    pub(crate) condition: String,
    pub(crate) names: [String; 2],
    /// Indices of the trials.
    pub(crate) first: usize,
    pub(crate) second: usize,
    /// The logs of all pairs, first and second in turn.
    pub(crate) logs: Vec<usize>,
    /// Whether the units are conditions: then differences are logarithms of ratios.
    pub(crate) over_conditions: bool,
    /// Whether the two saw other frames, of the same numbers, made with the same random numbers: what differs is a condition.
    pub(crate) between_conditions: bool,
    pub(crate) n: usize,
    /// Median of first − second (m), or of ln(first / second), and its 95 % interval.
    pub(crate) difference: f64,
    pub(crate) interval: (f64, f64),
    pub(crate) p: f64,
    pub(crate) holm: f64,
    pub(crate) effect: f64,
    /// Fixes found by the one alone, and by the other alone.
    pub(crate) alone: [usize; 2],
    pub(crate) mcnemar: f64,
    /// Where it is not significant: within how much of none at all the 90 % interval is (m, or the logarithm of a ratio). Two
    /// one-sided tests at 5 % show equivalence within any margin beyond this.
    pub(crate) margin: Option<f64>,
    /// The errors of both, until everything is said of them.
    errors: Vec<(f64, f64)>,
}

impl Comparison {
    /// Whether the two are shown to be equivalent within the margin; `None` where they differ. Medians do not see that one finds
    /// more than the other: where McNemar's test does, they are not.
    pub(crate) fn equivalent(&self) -> Option<bool> {
        let max = if self.over_conditions { MARGIN_RATIO.ln() } else { MARGIN };
        self.margin.map(|margin| margin <= max && self.mcnemar >= ALPHA)
    }

    /// The trial that errs less, if that is sure: by the test and by the interval.
    pub(crate) fn better(&self) -> Option<usize> {
        let (low, high) = self.interval;
        match self.holm < ALPHA {
            true if high < 0.0 => Some(self.first),
            true if low > 0.0 => Some(self.second),
            _ => None,
        }
    }
}

/// The trials that saw the same frames, by what those are.
pub(crate) fn groups(run: &Run) -> Vec<Vec<usize>> {
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (index, trial) in run.trials.iter().enumerate() {
        let data = data(trial, run.joined);
        match groups.iter_mut().find(|(known, _)| *known == data) {
            Some((_, members)) => members.push(index),
            None => groups.push((data, vec![index])),
        }
    }
    groups.into_iter().map(|(_, members)| members).collect()
}

/// What a trial was given: the same text, the same frames. Of several runs one may have stopped sooner; how many frames it was to
/// have is then no matter, what they saw is looked at by [`same_views`].
fn data(trial: &Trial, joined: bool) -> String {
    let header = &trial.header;
    let mut source = header.configuration.parse::<toml::Table>().ok().and_then(|table| table.get("source").cloned());
    if let Some(toml::Value::Table(source)) = source.as_mut().filter(|_| joined) {
        source.remove("frames");
    }
    let source = source.map_or_else(String::new, |source| source.to_string());
    format!("{}\n{source}\n{:?}\n{:?}\n{}", header.source, header.seeds, header.rig, header.site)
}

/// Whether two trials were at the same place at every frame that both have, as far as truth is logged: a dive of another length may
/// take another way.
fn same_views(first: &Trial, second: &Trial) -> bool {
    let places = |trial: &Trial| trial.frames.iter().map(|frame| (frame.number, frame.truth)).collect::<Vec<_>>();
    let theirs: BTreeMap<u64, Option<[f64; 3]>> = places(second).into_iter().collect();
    places(first).iter().all(|(number, truth)| theirs.get(number).is_none_or(|other| other == truth))
}

/// What tells the trials of a group apart, one name a member, and what they share.
pub(crate) fn names(run: &Run, members: &[usize]) -> (String, Vec<String>) {
    let axes = |index: usize| &run.trials[index].header.axes;
    let constant = |place: usize| members.iter().all(|&m| axes(m)[place].value == axes(members[0])[place].value);
    let (mut shared, mut differing) = (Vec::new(), Vec::new());
    for (place, axis) in axes(members[0]).iter().enumerate() {
        // A method that all share names no condition.
        match constant(place) {
            true => shared.push(format!("{} {}", format::short(&axis.key), axis.value)),
            false => differing.push(place),
        }
    }
    let name = |&index: &usize| {
        let values: Vec<String> = differing.iter().map(|&place| format::condition(&axes(index)[place])).collect();
        if values.is_empty() { run.trials[index].method().join(" + ") } else { values.join(", ") }
    };
    (shared.join(", "), members.iter().map(name).collect())
}

/// Every comparison the run allows, as one family.
pub(crate) fn comparisons(run: &Run, summary: &RunSummary) -> Vec<Comparison> {
    let groups: Vec<Vec<usize>> = groups(run).into_iter().filter(|group| group.len() > 1).collect();
    let mut family = match groups.len() {
        0 => between(run),
        n if n < CONDITIONS => within(run, &groups),
        _ => over_conditions(run, summary, &groups),
    };
    let adjusted = holm(&family.iter().map(|c| c.p).collect::<Vec<_>>());
    for (comparison, p) in family.iter_mut().zip(adjusted) {
        comparison.holm = p;
        let errors = std::mem::take(&mut comparison.errors);
        if comparison.better().is_none() {
            comparison.margin = Some(Statistics::margin(&errors, comparison.over_conditions));
        }
    }
    family
}

/// How many members groups of these sizes may have for all pairs of them to be compared.
fn max_in_all_pairs(sizes: impl Iterator<Item = usize>) -> usize {
    let pairs: usize = sizes.map(|n| if n <= ALL_PAIRS { n * n.saturating_sub(1) / 2 } else { n - 1 }).sum();
    if pairs <= READABLE { ALL_PAIRS } else { 4 }
}

/// Pairs of places: all of up to `max`, each with the first of more.
fn pairs(n: usize, max: usize) -> Vec<(usize, usize)> {
    let all = n <= max;
    (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).filter(|(a, _)| all || *a == 0).collect()
}

fn within(run: &Run, groups: &[Vec<usize>]) -> Vec<Comparison> {
    let mut found = Vec::new();
    let max = max_in_all_pairs(groups.iter().map(Vec::len));
    for members in groups {
        let (condition, names) = names(run, members);
        let axes = |place: usize| &run.trials[members[place]].header.axes[1..];
        let same = |a: usize, b: usize| {
            let equal = |(x, y): (&Axis, &Axis)| x.value == y.value || x.value == "–" || y.value == "–";
            run.trials[members[a]].header.axes[0] != run.trials[members[b]].header.axes[0]
                && axes(a).iter().zip(axes(b)).all(equal)
        };
        let mut chosen = pairs(members.len(), max);
        if run.joined {
            // Of several runs, what differs in nothing but the run; where nothing does, all.
            let n = members.len();
            let across = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).filter(|(a, b)| same(*a, *b));
            let across: Vec<(usize, usize)> = across.collect();
            chosen = if across.is_empty() { chosen } else { across };
        }
        for (a, b) in chosen {
            let (first, second) = (members[a], members[b]);
            let errors = errors(&run.trials[first], &run.trials[second]);
            if errors.is_empty() || run.joined && !same_views(&run.trials[first], &run.trials[second]) {
                continue;
            }
            let names = [names[a].clone(), names[b].clone()];
            found.push(of(condition.clone(), names, vec![first, second], false, errors));
        }
    }
    found
}

/// Conditions of one seed, where no two trials saw the same frames: frame k of each is drawn from the same random numbers, so
/// that attempts pair off by frame and target. Trials of other seeds, or with other targets, are left alone.
fn between(run: &Run) -> Vec<Comparison> {
    let alike = |trial: &Trial| {
        let targets: Vec<String> = trial.header.targets.iter().map(|target| target.id.clone()).collect();
        (trial.header.seeds.clone(), targets, trial.count(), trial.every())
    };
    let first = alike(&run.trials[0]);
    // Recorded frames have no random numbers in common.
    let plotted = !run.header().configuration.contains("name = \"dataset\"");
    if run.joined || !plotted || first.0.is_empty() || run.trials.iter().any(|trial| alike(trial) != first) {
        return Vec::new();
    }
    let members: Vec<usize> = (0..run.trials.len()).collect();
    let (_, names) = names(run, &members);
    let mut found = Vec::new();
    for (a, b) in pairs(members.len(), max_in_all_pairs([members.len()].into_iter())) {
        let errors = errors(&run.trials[a], &run.trials[b]);
        if !errors.is_empty() {
            let names = [names[a].clone(), names[b].clone()];
            let comparison = of(String::new(), names, vec![a, b], false, errors);
            found.push(Comparison { between_conditions: true, ..comparison });
        }
    }
    found
}

/// The errors m2 of both on the attempts that both made, in order of time; infinity where there is no right fix.
pub(crate) fn errors(first: &Trial, second: &Trial) -> Vec<(f64, f64)> {
    fn keyed(trial: &Trial) -> Vec<(u64, &str, f64)> {
        let attempts = trial.attempts();
        attempts.map(|(frame, row)| (frame.number, trial.object(row), row.error_or_failure(Field::Tre))).collect()
    }
    matched(keyed(first), keyed(second))
}

/// The values of both under the keys that both have, in the order of the keys; of several under one key the last.
fn matched<K: Ord>(first: Vec<(u64, K, f64)>, second: Vec<(u64, K, f64)>) -> Vec<(f64, f64)> {
    let ordered = |mut keyed: Vec<(u64, K, f64)>| {
        // Logs are in order as a rule; to sort takes memory even then.
        if !keyed.is_sorted_by(|a, b| (a.0, &a.1) <= (b.0, &b.1)) {
            keyed.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
        }
        keyed.dedup_by(|later, kept| {
            let same = (later.0, &later.1) == (kept.0, &kept.1);
            if same {
                kept.2 = later.2;
            }
            same
        });
        keyed
    };
    let (first, second) = (ordered(first), ordered(second));
    let mut other = second.into_iter().peekable();
    let mut pairs = Vec::with_capacity(first.len());
    for (number, key, value) in first {
        while other.next_if(|(n, k, _)| (*n, k) < (number, &key)).is_some() {}
        if let Some((_, _, theirs)) = other.next_if(|(n, k, _)| (*n, k) == (number, &key)) {
            pairs.push((value, theirs));
        }
    }
    pairs
}

/// One value a condition: the median of m2 over all attempts.
fn over_conditions(run: &Run, summary: &RunSummary, groups: &[Vec<usize>]) -> Vec<Comparison> {
    let named: Vec<(Vec<usize>, Vec<String>)> =
        groups.iter().map(|group| (group.clone(), names(run, group).1)).collect();
    let methods = distinct(named.iter().flat_map(|(_, names)| names.clone()));
    let mut found = Vec::new();
    for (a, b) in pairs(methods.len(), max_in_all_pairs([methods.len()].into_iter())) {
        let mut logs = Vec::new();
        for (group, names) in &named {
            let of = |method: &str| names.iter().position(|name| name == method).map(|place| group[place]);
            if let (Some(first), Some(second)) = (of(&methods[a]), of(&methods[b])) {
                logs.extend([first, second]);
            }
        }
        let tre = |index: usize| summary.rows[index].tre_of_all.unwrap_or(f64::INFINITY).ln();
        let errors: Vec<(f64, f64)> = logs.chunks(2).map(|pair| (tre(pair[0]), tre(pair[1]))).collect();
        if !errors.is_empty() {
            found.push(of(String::new(), [methods[a].clone(), methods[b].clone()], logs, true, errors));
        }
    }
    found
}

fn of(condition: String, names: [String; 2], logs: Vec<usize>, over: bool, errors: Vec<(f64, f64)>) -> Comparison {
    let statistics = Statistics::of(&errors, over);
    Comparison {
        condition,
        names,
        first: logs[0],
        second: logs[1],
        logs,
        over_conditions: over,
        between_conditions: false,
        n: errors.len(),
        difference: statistics.difference,
        interval: statistics.interval,
        p: statistics.p,
        holm: 1.0,
        effect: statistics.effect,
        alone: statistics.alone,
        mcnemar: mcnemar(statistics.alone[0], statistics.alone[1]),
        margin: None,
        errors,
    }
}

/// What pairs of errors say.
#[derive(Debug)]
pub(crate) struct Statistics {
    pub(crate) difference: f64,
    pub(crate) interval: (f64, f64),
    pub(crate) p: f64,
    pub(crate) effect: f64,
    pub(crate) alone: [usize; 2],
}

impl Statistics {
    /// Of pairs in the order of time, or of conditions, which have none.
    pub(crate) fn of(errors: &[(f64, f64)], conditions: bool) -> Self {
        let mut differences = differences(errors);
        let interval = bootstrap(differences.len(), conditions).median(&differences, 0.95);
        let test = signed_rank(errors);
        let alone = |one: fn(&(f64, f64)) -> [f64; 2]| {
            errors.iter().map(one).filter(|[own, other]| own.is_finite() && !other.is_finite()).count()
        };
        Self {
            difference: median(&mut differences),
            interval,
            p: test.p,
            effect: test.effect,
            alone: [alone(|(a, b)| [*a, *b]), alone(|(a, b)| [*b, *a])],
        }
    }
}

impl Statistics {
    /// Within how much of none at all the 90 % interval of the median difference is: where two one-sided tests at 5 % each find
    /// that it is smaller than some margin, the margin is at least this. Infinite of too few.
    pub(crate) fn margin(errors: &[(f64, f64)], conditions: bool) -> f64 {
        let differences = differences(errors);
        let bootstrap = bootstrap(differences.len(), conditions);
        if differences.len() < MIN_BLOCKS * bootstrap.block {
            return f64::INFINITY;
        }
        let (low, high) = bootstrap.median(&differences, 0.90);
        // Between the two infinities a median is no number: nothing is shown.
        if low.is_nan() || high.is_nan() { f64::INFINITY } else { low.abs().max(high.abs()) }
    }
}

/// First less second, in their order. Where both fail neither errs less.
fn differences(errors: &[(f64, f64)]) -> Vec<f64> {
    let finite = errors.iter().filter(|(a, b)| a.is_finite() || b.is_finite());
    let differences: Vec<f64> = finite.map(|(a, b)| a - b).collect();
    if differences.is_empty() { vec![0.0] } else { differences }
}

/// Conditions have no order of time, so that each stands by itself.
fn bootstrap(n: usize, conditions: bool) -> Bootstrap {
    let bootstrap = Bootstrap::of(n, SEED);
    if conditions { Bootstrap { block: 1, ..bootstrap } } else { bootstrap }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pair without a difference, or four, show nothing; many do.
    ///
    /// Seen to fail where the interval of one pair, which has no width, is believed.
    #[test]
    fn few_pairs_show_no_equivalence() {
        let alike = |n: usize| vec![(0.01, 0.01); n];
        assert!([0, 1, 4].iter().all(|&n| Statistics::margin(&alike(n), true).is_infinite()));
        assert_eq!(Statistics::margin(&alike(5), true), 0.0);
        assert!(Statistics::margin(&alike(5), false).is_infinite());
        assert_eq!(Statistics::margin(&alike(60), false), 0.0);
    }

    /// A method that fails half of the time, as another does at other times, is not shown to be as good; a small difference is.
    ///
    /// Seen to fail where the median between two infinities is passed over.
    #[test]
    fn what_is_within_the_margin_is_shown_by_the_interval() {
        let near: Vec<(f64, f64)> = (0..60).map(|i| (0.01, 0.01 + 1e-4 * f64::from(i % 7 - 3))).collect();
        let margin = Statistics::margin(&near, false);
        assert!(margin <= 2e-4, "{margin}");
        let none = f64::INFINITY;
        let apart: Vec<(f64, f64)> = (0..60).map(|i| if i % 2 == 0 { (none, 0.01) } else { (0.01, none) }).collect();
        assert_eq!(Statistics::margin(&apart, false), none);
        // The interval of 90 % is within that of 95 %.
        let (low, high) = Statistics::of(&near, false).interval;
        assert!(margin <= low.abs().max(high.abs()));
    }

    #[test]
    fn all_pairs_of_few_and_the_first_with_each_of_many() {
        assert_eq!(pairs(6, max_in_all_pairs([6].into_iter())).len(), 15);
        assert_eq!(pairs(9, max_in_all_pairs([9].into_iter())).len(), 8);
        let many = max_in_all_pairs([6; 7].into_iter());
        assert_eq!((many, pairs(6, many).len(), pairs(4, many).len()), (4, 5, 6));
    }

    /// Where both fail neither errs less: what one finds and the other does not is a difference, however many both miss.
    ///
    /// Seen to fail where two failures differ by zero.
    #[test]
    fn two_failures_state_nothing() {
        let none = f64::INFINITY;
        let errors: Vec<(f64, f64)> = (0..30).map(|i| (none, if i < 12 { 0.01 } else { none })).collect();
        let found = Statistics::of(&errors, false);
        assert_eq!((found.difference, found.interval), (none, (none, none)));
        assert!(found.p < 1e-3 && found.alone == [0, 12]);
        assert_eq!(Statistics::of(&[(none, none)], false).difference, 0.0);
    }

    /// Only what both have, by key, in the order of the keys, however they came; of several under one key the last counts.
    ///
    /// Seen to fail when the first of them does, and when keys are compared by their numbers alone.
    #[test]
    fn values_are_paired_by_key() {
        let first = vec![(2, "b", 5.0), (0, "a", 1.0), (2, "a", 3.0), (2, "a", 4.0), (7, "a", 6.0)];
        let second = vec![(0, "a", 10.0), (1, "a", 20.0), (2, "a", 30.0), (2, "b", 40.0), (2, "c", 50.0)];
        assert_eq!(matched(first, second), [(1.0, 10.0), (4.0, 30.0), (5.0, 40.0)]);
        assert!(matched(vec![(1, "a", 1.0)], vec![(1, "b", 1.0)]).is_empty());
    }
}
