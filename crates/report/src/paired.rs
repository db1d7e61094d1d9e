//! Paired comparisons of trials on the same frames.

use std::collections::BTreeMap;

use seafix_evaluation::{Bootstrap, holm, mcnemar, median, signed_rank};
use seafix_log::{Axis, TrialHeader};

use crate::{
    field::Field,
    format::{self, distinct},
    run::{AttemptRow, Run, Trial},
    summary::RunSummary,
};

/// The seed of the bootstrap, fixed so that results are reproducible.
pub(crate) const SEED: u64 = 20_211_038;
/// The family-wise significance level.
pub(crate) const ALPHA: f64 = 0.05;
/// The margin of equivalence of the median TRE difference (m), set before the experiments.
///
/// Trials without a significant difference are equivalent if the 90 % interval is within the margin.
pub(crate) const MARGIN: f64 = 1e-3;
/// The margin of equivalence of the ratio of median TREs over conditions, set before the experiments.
pub(crate) const MARGIN_RATIO: f64 = 1.1;
/// Minimum number of independent differences for a test of equivalence.
///
/// Below five, the median is outside the range of all differences with a probability above 10 %: 2 · 2⁻⁴.
const MIN_BLOCKS: usize = 5;
/// Maximum size of a group that is compared in all pairs.
///
/// Members of a larger group are compared with the first only.
pub(crate) const ALL_PAIRS: usize = 8;
/// Maximum number of comparisons in a readable table.
///
/// Beyond it only groups of up to four are compared in all pairs.
const READABLE: usize = 40;
/// Minimum number of conditions that are used as units of comparison, with one value each, instead of frames.
const CONDITIONS: usize = 10;

/// A comparison of two trials, or of two methods over many conditions, by the TRE.
///
/// Failures count as infinite errors.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// The common condition of both trials; empty over conditions.
    pub(crate) condition: String,
    pub(crate) names: [String; 2],
    /// The index of the first trial.
    pub(crate) first: usize,
    pub(crate) second: usize,
    /// The indices of the logs of all pairs, first and second alternating.
    pub(crate) logs: Vec<usize>,
    /// Whether the units are conditions; differences are logarithms of ratios then.
    pub(crate) over_conditions: bool,
    /// Whether the trials differ in a condition and their frames are generated from the same random numbers.
    pub(crate) between_conditions: bool,
    pub(crate) n: usize,
    /// The median of first − second (m), or of ln(first / second).
    pub(crate) difference: f64,
    pub(crate) interval: (f64, f64),
    pub(crate) p: f64,
    pub(crate) holm: f64,
    pub(crate) effect: f64,
    /// The number of pairs with a fix of the first trial only, and of the second only.
    pub(crate) alone: [usize; 2],
    pub(crate) mcnemar: f64,
    /// The largest absolute end of the 90 % interval (m, or logarithm of a ratio).
    ///
    /// Only a difference that is not significant has it. Two one-sided tests at 5 % show equivalence within any larger
    /// margin.
    pub(crate) margin: Option<f64>,
    /// The errors of both, kept until the margin is computed.
    errors: Vec<(f64, f64)>,
}

impl Comparison {
    /// Whether equivalence within the margin is shown; `None` for a significant difference.
    ///
    /// Medians are blind to different numbers of fixes, so McNemar's test must not be significant either.
    pub(crate) fn equivalent(&self) -> Option<bool> {
        let max = if self.over_conditions { MARGIN_RATIO.ln() } else { MARGIN };
        self.margin.map(|margin| margin <= max && self.mcnemar >= ALPHA)
    }

    /// The trial with the smaller error, if both the test and the interval show a significant difference.
    pub(crate) fn better(&self) -> Option<usize> {
        let (low, high) = self.interval;
        match self.holm < ALPHA {
            true if high < 0.0 => Some(self.first),
            true if low > 0.0 => Some(self.second),
            _ => None,
        }
    }
}

/// The groups of trials on the same frames.
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

/// A text that identifies the data of a trial: equal texts, equal frames.
///
/// Joined runs may have different lengths, so the number of frames is ignored; [`same_views`] compares their views.
pub(crate) fn data(trial: &Trial, joined: bool) -> String {
    data_of(&trial.header, joined)
}

/// The largest number of these trials that have the same data: so many attempts are those at one target of one frame.
pub(crate) fn sharing<'a>(headers: impl Iterator<Item = &'a TrialHeader>) -> usize {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    headers.for_each(|header| *counts.entry(data_of(header, false)).or_default() += 1);
    counts.into_values().max().unwrap_or(1)
}

fn data_of(header: &TrialHeader, joined: bool) -> String {
    let mut source = header.configuration.parse::<toml::Table>().ok().and_then(|table| table.get("source").cloned());
    if let Some(toml::Value::Table(source)) = source.as_mut().filter(|_| joined) {
        source.remove("frames");
    }
    let source = source.map_or_else(String::new, |source| source.to_string());
    format!("{}\n{source}\n{:?}\n{:?}\n{}", header.source, header.seeds, header.rig, header.site)
}

/// Whether two trials have the same true position at every common frame.
///
/// Frames without ground truth are ignored. A dive of another length may take another route.
fn same_views(first: &Trial, second: &Trial) -> bool {
    let places = |trial: &Trial| trial.frames.iter().map(|frame| (frame.number, frame.truth)).collect::<Vec<_>>();
    let theirs: BTreeMap<u64, Option<[f64; 3]>> = places(second).into_iter().collect();
    places(first).iter().all(|(number, truth)| theirs.get(number).is_none_or(|other| other == truth))
}

/// The common condition of a group of trials, and a distinguishing name for each member.
pub(crate) fn names(run: &Run, members: &[usize]) -> (String, Vec<String>) {
    let axes = |index: usize| &run.trials[index].header.axes;
    let constant = |place: usize| members.iter().all(|&m| axes(m)[place].value == axes(members[0])[place].value);
    let (mut shared, mut differing) = (Vec::new(), Vec::new());
    for (place, axis) in axes(members[0]).iter().enumerate() {
        // Common values form the condition, differing values the names.
        match constant(place) {
            true => shared.push(format::placed(&axis.key, &axis.value)),
            false => differing.push(place),
        }
    }
    let name = |&index: &usize| {
        let values: Vec<String> = differing.iter().map(|&place| format::condition(&axes(index)[place])).collect();
        if values.is_empty() { run.trials[index].method().join(" + ") } else { values.join(", ") }
    };
    (shared.join(", "), members.iter().map(name).collect())
}

/// All comparisons that the run allows, Holm-adjusted as one family.
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

/// Maximum size of a group that is compared in all pairs, given the sizes of all groups.
fn max_in_all_pairs(sizes: impl Iterator<Item = usize>) -> usize {
    let pairs: usize = sizes.map(|n| if n <= ALL_PAIRS { n * n.saturating_sub(1) / 2 } else { n - 1 }).sum();
    if pairs <= READABLE { ALL_PAIRS } else { 4 }
}

/// All pairs of `n` indices, or those with the first index if `n` is larger than `max`.
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
            // Joined runs: pairs that differ only in the run, or all pairs if there are none.
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

/// The comparisons between conditions of one seed, for runs in which no two trials have the same frames.
///
/// Frame k of every trial is generated from the same random numbers, so attempts are paired by frame and target. Trials
/// with different seeds or targets are not compared.
fn between(run: &Run) -> Vec<Comparison> {
    if run.joined || run.trials.iter().any(|trial| !alike(&run.trials[0], trial)) {
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

/// Whether the frames of two trials are generated from the same random numbers, frame by frame.
fn alike(first: &Trial, second: &Trial) -> bool {
    let random = |trial: &Trial| {
        let targets: Vec<String> = trial.header.targets.iter().map(|target| target.id.clone()).collect();
        (trial.header.seeds.clone(), targets, trial.count(), trial.every())
    };
    // Recorded frames have no random numbers in common.
    let simulated = !first.header.configuration.contains("name = \"dataset\"");
    simulated && !first.header.seeds.is_empty() && random(first) == random(second)
}

/// Whether attempts of two trials can be compared in pairs: they have the same frames, or the same random numbers.
pub(crate) fn comparable(run: &Run, first: &Trial, second: &Trial) -> bool {
    data(first, run.joined) == data(second, run.joined) || !run.joined && alike(first, second)
}

/// The TREs (m) of both on their common attempts, in order of time.
///
/// The TRE of a rejected attempt or a wrong fix is infinite.
pub(crate) fn errors(first: &Trial, second: &Trial) -> Vec<(f64, f64)> {
    values(first, second, |row| row.error_or_failure(Field::Tre))
}

/// A value of both on their common attempts, in order of time.
pub(crate) fn values(first: &Trial, second: &Trial, of: impl Fn(&AttemptRow) -> f64) -> Vec<(f64, f64)> {
    fn keyed<'a>(trial: &'a Trial, of: &impl Fn(&AttemptRow) -> f64) -> Vec<(u64, &'a str, f64)> {
        trial.attempts().map(|(frame, row)| (frame.number, trial.object(row), of(row))).collect()
    }
    matched(keyed(first, &of), keyed(second, &of))
}

/// The values of both under their common keys, in the order of the keys.
///
/// The last value of a repeated key counts.
fn matched<K: Ord>(first: Vec<(u64, K, f64)>, second: Vec<(u64, K, f64)>) -> Vec<(f64, f64)> {
    let ordered = |mut keyed: Vec<(u64, K, f64)>| {
        // Logs are usually in order, and sorting takes memory even then.
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

/// The comparisons of methods over conditions, with the median TRE over all attempts of each condition.
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

/// The statistics of paired errors.
#[derive(Debug)]
pub(crate) struct Statistics {
    pub(crate) difference: f64,
    pub(crate) interval: (f64, f64),
    pub(crate) p: f64,
    pub(crate) effect: f64,
    pub(crate) alone: [usize; 2],
}

impl Statistics {
    /// The statistics of pairs in order of time, or of conditions, which have no order.
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
    /// The largest absolute end of the 90 % interval of the median difference.
    ///
    /// The result is infinite for too few pairs.
    ///
    /// It is the smallest margin within which two one-sided tests at 5 % show equivalence.
    pub(crate) fn margin(errors: &[(f64, f64)], conditions: bool) -> f64 {
        let differences = differences(errors);
        let bootstrap = bootstrap(differences.len(), conditions);
        if differences.len() < MIN_BLOCKS * bootstrap.block {
            return f64::INFINITY;
        }
        let (low, high) = bootstrap.median(&differences, 0.90);
        // The median between both infinities is NaN, and equivalence is not shown.
        if low.is_nan() || high.is_nan() { f64::INFINITY } else { low.abs().max(high.abs()) }
    }
}

/// The differences first − second, in order, of pairs that do not both fail.
fn differences(errors: &[(f64, f64)]) -> Vec<f64> {
    let finite = errors.iter().filter(|(a, b)| a.is_finite() || b.is_finite());
    let differences: Vec<f64> = finite.map(|(a, b)| a - b).collect();
    if differences.is_empty() { vec![0.0] } else { differences }
}

/// The bootstrap; conditions have no order of time, so their blocks have length one.
fn bootstrap(n: usize, conditions: bool) -> Bootstrap {
    let bootstrap = Bootstrap::of(n, SEED);
    if conditions { Bootstrap { block: 1, ..bootstrap } } else { bootstrap }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up to four equal pairs show no equivalence; many do.
    ///
    /// Seen to fail where the interval of a single pair, which has zero width, is accepted.
    #[test]
    fn few_pairs_show_no_equivalence() {
        let alike = |n: usize| vec![(0.01, 0.01); n];
        assert!([0, 1, 4].iter().all(|&n| Statistics::margin(&alike(n), true).is_infinite()));
        assert_eq!(Statistics::margin(&alike(5), true), 0.0);
        assert!(Statistics::margin(&alike(5), false).is_infinite());
        assert_eq!(Statistics::margin(&alike(60), false), 0.0);
    }

    /// Two methods that fail at different times are not shown to be equivalent.
    ///
    /// Two methods with small differences are.
    ///
    /// Seen to fail where the NaN median between both infinities is ignored.
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

    /// Pairs that both fail are ignored; a fix of only one trial is a difference.
    ///
    /// Seen to fail where two failures count as a difference of zero.
    #[test]
    fn two_failures_state_nothing() {
        let none = f64::INFINITY;
        let errors: Vec<(f64, f64)> = (0..30).map(|i| (none, if i < 12 { 0.01 } else { none })).collect();
        let found = Statistics::of(&errors, false);
        assert_eq!((found.difference, found.interval), (none, (none, none)));
        assert!(found.p < 1e-3 && found.alone == [0, 12]);
        assert_eq!(Statistics::of(&[(none, none)], false).difference, 0.0);
    }

    /// Only common keys are paired, in the order of the keys for any input order.
    ///
    /// The last value of a repeated key counts.
    ///
    /// Seen to fail where the first value counts, and where keys are compared by frame number only.
    #[test]
    fn values_are_paired_by_key() {
        let first = vec![(2, "b", 5.0), (0, "a", 1.0), (2, "a", 3.0), (2, "a", 4.0), (7, "a", 6.0)];
        let second = vec![(0, "a", 10.0), (1, "a", 20.0), (2, "a", 30.0), (2, "b", 40.0), (2, "c", 50.0)];
        assert_eq!(matched(first, second), [(1.0, 10.0), (4.0, 30.0), (5.0, 40.0)]);
        assert!(matched(vec![(1, "a", 1.0)], vec![(1, "b", 1.0)]).is_empty());
    }
}
