//! Numbers of trials with their keys, and the words for outcomes.

use crate::{
    field::Field,
    format,
    navigation_quantity::NavigationQuantity,
    number::{Key, Number},
    paired,
    points_of_interest::PoiQuantity,
    proportion,
    run::{AttemptRow, Trial},
};

/// The unit in which a quantity is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    Plain,
    Millimetres,
    Degrees,
}

impl Unit {
    pub(crate) fn scale(self) -> f64 {
        match self {
            Self::Plain => 1.0,
            Self::Millimetres => 1e3,
            Self::Degrees => 1_f64.to_degrees(),
        }
    }

    /// The end of a key with the unit.
    pub(crate) fn suffix(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Millimetres => " in mm",
            Self::Degrees => " in deg",
        }
    }
}

/// The topic of a trial's counts: the totals where the log has them.
fn counted(trial: &Trial) -> &'static str {
    if trial.totals.is_some() { "/metrics/totals" } else { "/metrics/evaluation" }
}

/// The printed word for a counted group: keys keep the names `found` and `refused`.
pub(crate) fn outcome(group: &str) -> &str {
    match group {
        "attempted" => "attempts",
        "found" => "fixes",
        "refused" => "rejected",
        _ => group,
    }
}

/// The number of attempts of `group`.
pub(crate) fn count(trial: &Trial, group: &str, n: usize) -> Number {
    Number::count(n, Key::of(trial, counted(trial), format!("count {group}")))
}

/// The fraction of `group` among all attempts (%).
pub(crate) fn percent(trial: &Trial, group: &str, k: usize, n: usize) -> Number {
    let key = Key::of(trial, counted(trial), format!("percent {group} of attempted"));
    Number::new((n > 0).then(|| 100.0 * k as f64 / n as f64), 1, key)
}

/// Whether an attempt belongs to `group`, an outcome or a region of the Stanford diagram.
fn is_of(row: &AttemptRow, group: &str) -> bool {
    match group {
        "found" => row.found(),
        "wrong" => row.wrong(),
        "refused" => !row.found() && !row.wrong(),
        _ => row.region().is_some_and(|region| region.name() == group),
    }
}

/// The 95 % interval of the fraction of `group`.
///
/// It is [`proportion::interval`] of the single attempts, or [`proportion::interval_of_counts`] for a decimated log,
/// which has only counts of the skipped frames.
fn ends(trial: &Trial, group: &str, k: usize, n: usize) -> (f64, f64) {
    if trial.every() > 1 || !proportion::is_trajectory(&trial.header) {
        return proportion::interval_of_counts(proportion::is_trajectory(&trial.header), k, n);
    }
    let events: Vec<bool> = trial.attempts().map(|(_, row)| is_of(row, group)).collect();
    proportion::interval(true, &events)
}

/// The fraction of `group` among all attempts (%), or an end of its 95 % interval: `percent`, `low`, `high`.
pub(crate) fn rate(trial: &Trial, what: &str, group: &str, (k, n): (usize, usize), decimals: usize) -> Number {
    let (low, high) = ends(trial, group, k, n);
    let value = match what {
        "low" => 100.0 * low,
        "high" => 100.0 * high,
        _ => 100.0 * k as f64 / n as f64,
    };
    let key = Key::of(trial, counted(trial), format!("{what} {group} of attempted"));
    Number::new((n > 0).then_some(value), decimals, key)
}

/// The number of attempts of `group` over several trials.
pub(crate) fn pooled_count(trials: &[&Trial], group: &str, n: usize) -> Number {
    Number::count(n, over(trials, "/metrics/evaluation", format!("count {group}")))
}

/// The fraction of `group` among the attempts of several trials (%), and the ends of its 95 % interval.
pub(crate) fn pooled_rate(trials: &[&Trial], group: &str, (k, n): (usize, usize)) -> [Number; 3] {
    let trajectory = trials.iter().any(|trial| proportion::is_trajectory(&trial.header));
    let sharing = if trials.len() > 1 { paired::sharing(trials.iter().map(|trial| &trial.header)) } else { 1 };
    let (low, high) = if sharing > 1 || !trajectory || trials.iter().any(|trial| trial.every() > 1) {
        proportion::interval_of_shared(trajectory, sharing, k, n)
    } else {
        let attempts = trials.iter().flat_map(|trial| trial.attempts());
        proportion::interval(true, &attempts.map(|(_, row)| is_of(row, group)).collect::<Vec<bool>>())
    };
    // 100 k / n as everywhere: 100 (k / n) rounds ties such as 102 of 160 differently.
    [("percent", 100.0 * k as f64 / n as f64), ("low", 100.0 * low), ("high", 100.0 * high)].map(|(what, percent)| {
        let key = over(trials, "/metrics/evaluation", format!("{what} {group} of attempted"));
        Number::new((n > 0).then_some(percent), 1, key)
    })
}

/// The median of a quantity over the fixes of a trial, and the ends of its 95 % interval.
pub(crate) fn median(trial: &Trial, field: Field, unit: (Unit, usize)) -> [Number; 3] {
    let found = trial.attempts().filter(|(_, row)| row.found());
    let mut values: Vec<f64> = found.filter_map(|(_, row)| row.get(field)).collect();
    let interval = proportion::median_interval(proportion::is_trajectory(&trial.header), &mut values);
    let median = interval.map(|_| seafix_evaluation::quantile(&mut values, 0.5));
    let [low, high] = [interval.map(|(low, _)| low), interval.map(|(_, high)| high)];
    [("median", median), ("median-low", low), ("median-high", high)]
        .map(|(name, value)| statistic(trial, name, field, "found", value, unit))
}

/// The 95 % interval of the fraction of `group` (%).
///
/// It has two decimals from a thousand attempts on: with one decimal it would print as the fraction itself.
pub(crate) fn interval(trial: &Trial, group: &str, k: usize, n: usize) -> [Number; 2] {
    let (low, high) = ends(trial, group, k, n);
    let decimals = if n < 1000 { 1 } else { 2 };
    [("low", low), ("high", high)].map(|(end, value)| {
        let key = Key::of(trial, counted(trial), format!("{end} {group} of attempted"));
        Number::new((n > 0).then_some(100.0 * value), decimals, key)
    })
}

/// A statistic of a quantity over the attempts of a group, with the key `median tre_rms of found`.
pub(crate) fn statistic(
    trial: &Trial,
    name: &str,
    field: Field,
    group: &str,
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let what = format!("{name} {} of {group}{}", field.name(), unit.suffix());
    Number::new(value.map(|value| value * unit.scale()), decimals, Key::of(trial, field.topic(), what))
}

/// A statistic of a navigated quantity over the frames that have it.
pub(crate) fn navigated(
    trial: &Trial,
    name: &str,
    quantity: NavigationQuantity,
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    navigated_over(trial, trial.span(), name, quantity, value, (unit, decimals))
}

/// A statistic of a navigated quantity over the frames of a part of a trial, from its first to its last stamp (ns).
pub(crate) fn navigated_over(
    trial: &Trial,
    span: [u64; 2],
    name: &str,
    quantity: NavigationQuantity,
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let what = format!("{name} {} of navigated{}", quantity.name(), unit.suffix());
    let key = Key { span, ..Key::of(trial, "/referencing/frame", what) };
    Number::new(value.map(|value| value * unit.scale()), decimals, key)
}

/// A statistic of a point of interest over the frames that have it in view.
pub(crate) fn poi(
    trial: &Trial,
    name: &str,
    (quantity, point): (PoiQuantity, &str),
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let what = format!("{name} {} at the point {point}{}", quantity.name(), unit.suffix());
    Number::new(value.map(|value| value * unit.scale()), decimals, Key::of(trial, "/metrics/inspection", what))
}

/// A navigated quantity after one frame.
pub(crate) fn navigated_at(
    trial: &Trial,
    (frame, stamp_ns): (u64, u64),
    quantity: NavigationQuantity,
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let key = Key {
        what: format!("value {} of  at {frame}{}", quantity.name(), unit.suffix()),
        topic: "/referencing/frame".to_owned(),
        span: [stamp_ns; 2],
        logs: vec![trial.file()],
    };
    Number::new(value.map(|value| value * unit.scale()), decimals, key)
}

/// A quantity of one attempt.
pub(crate) fn value(
    trial: &Trial,
    (object, frame, stamp_ns): (&str, u64, u64),
    field: Field,
    value: Option<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let key = Key {
        what: format!("value {} of {object} at {frame}{}", field.name(), unit.suffix()),
        topic: field.topic().to_owned(),
        span: [stamp_ns; 2],
        logs: vec![trial.file()],
    };
    Number::new(value.map(|value| value * unit.scale()), decimals, key)
}

/// A key over several logs.
///
/// A count is summed over them; `least`, `greatest` and `middle` select among their values.
pub(crate) fn over(trials: &[&Trial], topic: &str, what: String) -> Key {
    let spans = trials.iter().map(|trial| trial.span());
    let span = spans.fold([u64::MAX, 0], |[a, b], [from, to]| [a.min(from), b.max(to)]);
    Key { what, topic: topic.to_owned(), span, logs: trials.iter().map(|trial| trial.file()).collect() }
}

/// A number from the header of a trial.
pub(crate) fn header(trial: &Trial, what: &str, value: Option<f64>, decimals: usize) -> Number {
    Number::new(value, decimals, Key { span: [0; 2], ..Key::of(trial, "/run/header", what) })
}

/// The value of a trial on an axis.
pub(crate) fn axis(trial: &Trial, key: &str, value: Option<f64>) -> Number {
    header(trial, &format!("axis {key}"), value, 4)
}

/// The number of a frame.
pub(crate) fn frame(trial: &Trial, number: u64, stamp_ns: u64) -> Number {
    let key = Key { span: [stamp_ns; 2], ..Key::of(trial, "/referencing/frame", "frame") };
    Number::count(number as usize, key)
}

/// The number of decimals that a column of `values` needs.
pub(crate) fn decimals(values: impl Iterator<Item = Option<f64>>, unit: Unit) -> usize {
    format::decimals(values.flatten().map(|value| value * unit.scale()))
}
