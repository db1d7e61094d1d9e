//! The evaluation of keys from the logs, by the definitions of their quantities.

use std::{collections::BTreeMap, rc::Rc};

use seafix_evaluation::{Difference, holm, mcnemar, quantile};
use seafix_log::{FrameTimes, Outcome, TargetRecord};

use crate::{
    error::ReportError,
    field::Field,
    fix_intervals::{FixInterval, fix_intervals},
    lever::ARMS,
    navigation_quantity::{Counted, NavigationQuantity},
    number::Key,
    paired::Statistics,
    points_of_interest::{self, PoiQuantity},
    proportion::{self, BORNE},
    rms,
    verify::{
        counts::{class, end_of, fraction_of, histogram, pooled},
        logs::{Log, Logs, Seen},
        rows::{error, found, rows, value},
        written::{combined, extreme, f1, in_common},
    },
};

/// The value of a key, `None` for a dash, or the reason why it cannot be computed.
type Answer = Result<Option<f64>, String>;

/// Computes the value of `key`.
pub(super) fn evaluate(key: &Key, logs: &mut Logs) -> Result<Answer, ReportError> {
    for name in &key.logs {
        if logs.get(name)?.is_none() {
            return Ok(Err(format!("the log {name} is missing")));
        }
    }
    let mut all: Vec<&Log> = Vec::new();
    let logs: &Logs = logs;
    for name in &key.logs {
        all.extend(logs.known(name));
    }
    Ok(answer(&key.what, key.span, &all).ok_or_else(|| format!("unknown quantity `{}`", key.what)))
}

/// The value of a quantity: `None` if it is unknown, `Some(None)` for a dash.
fn answer(what: &str, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    if let Some(of) = what.strip_prefix("combined ") {
        return combined(of, span, logs, answer).map(Some);
    }
    if let Some((name, of)) = what.split_once(' ').filter(|(name, _)| matches!(*name, "smallest-of" | "largest-of")) {
        return extreme(name, of, span, logs, answer);
    }
    let (what, scale) = match what {
        _ if what.ends_with(" in mm") => (what.trim_end_matches(" in mm"), 1e3),
        _ if what.ends_with(" in deg") => (what.trim_end_matches(" in deg"), 1_f64.to_degrees()),
        _ => (what, 1.0),
    };
    let (first, rest) = what.split_once(' ').unwrap_or((what, ""));
    let log = logs.first()?;
    let scaled = |value: Option<f64>| value.map(|value| value * scale);
    if matches!(first, "least" | "greatest" | "middle")
        && !rest.ends_with(" of navigated")
        && !rest.contains(" at the point ")
    {
        return of_logs(first, rest, scale, span, logs);
    }
    if let Some(group) = rest.strip_suffix(" of common") {
        return in_common(first, group, span, logs).map(scaled);
    }
    if let Some((quantity, point)) = rest.split_once(" at the point ") {
        return poi(first, quantity, point, span, log).map(scaled);
    }
    if let Some((of, object)) = rest.split_once(" on the object ") {
        return on_object(first, of, object, span, log).map(scaled);
    }
    if let Some(what) = rest.strip_suffix(" over pairs") {
        return Some(scaled(in_pairs(first, what, logs, span)));
    }
    if let Some((_, over)) = rest.split_once(" over ") {
        return compared(first, over, logs, span);
    }
    if let Some(of) = rest.strip_suffix(" half octaves of candidates") {
        return by_candidates(first, of, span, logs);
    }
    elementary(first, rest, scale, span, logs)
}

/// The value of a quantity without a relation of logs, objects or points.
fn elementary(first: &str, rest: &str, scale: f64, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let log = logs.first()?;
    let scaled = |value: Option<f64>| value.map(|value| value * scale);
    match (first, rest) {
        ("borne" | "surely-borne", of) => borne(first, of, scale, span, logs),
        ("axis" | "every" | "frame" | "stamp" | "marks" | "disparity", of) => recorded(first, of, span, log),
        (_, range) if range.starts_with("p_wrong from ") => class(first, range, span, logs),
        ("count" | "density", range) if range.contains(" from ") => Some(histogram(first, range, span, logs)),
        (_, group) if group.ends_with(" with one target") || group.ends_with(" with several targets") => {
            Some(with_targets(first, group, span, log))
        }
        ("count", group) => count(group, span, logs).map(Some),
        ("percent" | "low" | "high", group) => fraction_of(first, group, scale, span, logs),
        ("f1", _) => Some(f1(log, span)),
        ("sum", fields) => quotient(fields, span, log).map(Some),
        ("rms" | "rms-low" | "rms-high", of) if of.ends_with(" of navigated") => {
            navigated_rms(first, of, span, log).map(scaled)
        }
        ("rms" | "bound" | "ratio" | "ratio-low" | "ratio-high" | "within", of) => {
            totals(first, of, span, log).map(scaled)
        }
        ("mean", "nees of judged") => totals(first, rest, span, log),
        ("value", of) => single(of, span, log).map(scaled),
        (place, of) if place.starts_with("place-") => located(place, of, span, log),
        ("area", of) => {
            let (field, bound) = of.strip_suffix(" of attempted")?.split_once("<=")?;
            let (field, bound) = (Field::named(field)?, bound.parse::<f64>().ok()? / scale);
            Some(area(rows(log, span).map(|row| &row.record), field, bound))
        }
        ("intervals", of) => toothed(of.strip_suffix(" of navigated")?, span, log).map(scaled),
        ("all", of) => median_of_attempts(of, span, log).map(scaled),
        (name, of) => distribution(name, of, span, log).map(scaled),
    }
}

/// The smallest, largest or middle value of a quantity over single logs, those without a value skipped.
fn of_logs(name: &str, of: &str, scale: f64, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let each: Option<Vec<Option<f64>>> = logs.iter().map(|log| answer(of, span, &[log])).collect();
    let mut each: Vec<f64> = each?.into_iter().flatten().map(|value| value * scale).collect();
    Some(match name {
        "least" => each.iter().copied().reduce(f64::min),
        "greatest" => each.iter().copied().reduce(f64::max),
        _ => (!each.is_empty()).then(|| quantile(&mut each, 0.5)),
    })
}

/// The value of `NAME FIELD at BIN half octaves of candidates`.
fn by_candidates(name: &str, of: &str, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let (field, bin) = of.split_once(" at ")?;
    let (field, bin): (Field, f64) = (Field::named(field)?, bin.parse().ok()?);
    let own = logs.iter().flat_map(|log| rows(log, span)).filter(|row| row.candidates > 0);
    let own = own.filter(|row| (2.0 * (row.candidates as f64).log2()).round() / 2.0 == bin);
    statistic(name, own.filter_map(|row| field.of(&row.record)).filter(|cost| *cost > 0.0).collect())
}

/// The last value of an axis before the fraction of fixes, or the lower end of its interval, is too small.
fn borne(name: &str, of: &str, scale: f64, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let key = of.strip_prefix("found along ")?;
    let end = if name == "borne" { "percent" } else { "low" };
    let mut largest = None;
    for log in logs {
        let fraction = fraction_of(end, "found of attempted", scale, span, &[log])?;
        if fraction.is_none_or(|fraction| fraction < BORNE) {
            break;
        }
        largest = Some(log.header.axes.iter().find(|axis| axis.key == key)?.value.parse().ok()?);
    }
    Some(largest)
}

/// A value of the log or of its first frame within the stamps, as it is recorded.
fn recorded(name: &str, of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    Some(match name {
        "axis" => log.header.axes.iter().find(|axis| axis.key == of)?.value.parse().ok(),
        "every" => Some(log.totals.as_ref()?.every as f64),
        "frame" => Some(at(log, span)?.number as f64),
        "stamp" => Some(at(log, span)?.stamp_ns as f64),
        "marks" => {
            let place = ["corners", "cloud", "candidates", "identified", "used"].iter().position(|n| *n == of)?;
            Some(at(log, span)?.marks[place] as f64)
        }
        _ => (log.disparity.1 > 0).then(|| (log.disparity.0 / log.disparity.1 as f64).sqrt()),
    })
}

/// A statistic of the frames with one or with several targets: whether a target has a fix.
fn with_targets(which: &str, group: &str, span: [u64; 2], log: &Log) -> Option<f64> {
    let several = group.ends_with(" several targets");
    let own = log.sample(span).filter(|frame| if several { frame.rows.len() > 1 } else { frame.rows.len() == 1 });
    let events: Vec<bool> = own.map(|frame| frame.rows.iter().any(|row| found(&row.record))).collect();
    end_of(which, log, &events)
}

/// The number of frames or attempts of a group.
fn count(group: &str, span: [u64; 2], logs: &[&Log]) -> Option<f64> {
    let log = logs.first()?;
    if let Some(counted) = Counted::ALL.into_iter().find(|counted| counted.name() == group) {
        let records = log.sample(span).filter_map(|frame| frame.navigation.as_deref());
        return Some(records.filter(|record| counted.holds(record)).count() as f64);
    }
    if let Some(of) = group.strip_suffix(" targets") {
        let (which, size) = of.split_once(" with ")?;
        let size: usize = size.parse().ok()?;
        let own = logs.iter().flat_map(|log| log.sample(span)).filter(|frame| frame.rows.len() == size);
        let own = own.filter(|frame| which == "frames" || frame.rows.iter().any(|row| found(&row.record)));
        return Some(own.count() as f64);
    }
    Some(if group == "logged" { rows(log, span).count() } else { pooled(logs, group, span)? } as f64)
}

/// The sum of one field divided by that of another.
fn quotient(fields: &str, span: [u64; 2], log: &Log) -> Option<f64> {
    // Correct pairs are known for fixes only.
    let (above, below) = fields.split_once(" by ")?;
    let (below, fixes) = below.strip_suffix(" of fixes").map_or((below, false), |below| (below, true));
    let (above, below) = (Field::named(above)?, Field::named(below)?);
    let own = || rows(log, span).filter(|row| !fixes || row.record.outcome == Outcome::Fix);
    let sum = |field: Field| own().filter_map(|row| field.of(&row.record)).sum::<f64>();
    Some(sum(above) / sum(below))
}

/// The RMS of a navigation quantity over the frames that have it, or an end of its interval.
fn navigated_rms(which: &str, of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let quantity = NavigationQuantity::named(of.strip_suffix(" of navigated")?)?;
    let values = navigation_values(quantity, span, log);
    let n = values.len();
    Some(match which {
        "rms-low" => rms::over_frames(&values).map(|ends| ends.0),
        "rms-high" => rms::over_frames(&values).map(|ends| ends.1),
        _ => (n > 0).then(|| (values.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt()),
    })
}

fn navigation_values(quantity: NavigationQuantity, span: [u64; 2], log: &Log) -> Vec<f64> {
    log.sample(span).filter_map(|frame| quantity.of(frame.navigation.as_deref()?)).collect()
}

/// The lower median of an error over all attempts, with infinity for those without a fix.
fn median_of_attempts(of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let field = Field::named(of.strip_suffix(" of attempted")?)?;
    let known = rows(log, span).any(|row| found(&row.record) && field.of(&row.record).is_some());
    let mut values: Vec<f64> = rows(log, span).map(|row| error(&row.record, field)).collect();
    values.sort_by(f64::total_cmp);
    Some(values.get(values.len().saturating_sub(1) / 2).copied().filter(|_| known))
}

/// A statistic of a field, a navigation quantity, an error at a lever arm or the time of a stage.
fn distribution(name: &str, of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let (field, group) = of.split_once(" of ")?;
    let values: Vec<f64> = if let Some(field) = Field::named(field) {
        let own = rows(log, span).filter(|row| group == "attempted" || found(&row.record));
        own.filter_map(|row| value(row, field)).collect()
    } else if let Some(quantity) = NavigationQuantity::named(field) {
        navigation_values(quantity, span, log)
    } else if let Some(length) = field.strip_prefix("arm_") {
        let length: f64 = length.parse().ok()?;
        let place = ARMS.iter().position(|arm| *arm == length)?;
        let own = rows(log, span).filter(|row| found(&row.record)).map(|row| row.arms[place]);
        own.filter(|error| !error.is_nan()).collect()
    } else {
        log.sample(span).filter_map(|frame| stage(&frame.times, field)).collect()
    };
    of_median(name, log, values)
}

/// The value of `NAME QUANTITY at the point OBJECT/POINT`, over the frames with the point in view.
fn poi(name: &str, quantity: &str, point: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let own = log.sample(span).flat_map(|frame| &frame.poi).filter(|seen| points_of_interest::name(seen) == point);
    if (name, quantity) == ("count", "views") {
        return Some(Some(own.count() as f64));
    }
    let quantity = PoiQuantity::named(quantity)?;
    of_median(name, log, own.filter_map(|seen| quantity.of(seen)).collect())
}

/// The value of `count GROUP on the object NAME` or `NAME FIELD of found on the object NAME`.
fn on_object(name: &str, of: &str, object: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let own = || rows(log, span).filter(|row| row.record.object == object);
    let is: fn(&TargetRecord) -> bool = match of {
        "attempted" => |_| true,
        "refused" => |row| row.outcome != Outcome::Fix,
        "wrong" => |row| row.outcome == Outcome::Fix && !found(row),
        _ => found,
    };
    match name {
        "count" => return Some(Some(own().filter(|row| is(&row.record)).count() as f64)),
        "percent" | "low" | "high" => {
            return Some(end_of(name, log, &own().map(|row| is(&row.record)).collect::<Vec<bool>>()));
        }
        _ => {}
    }
    let field = Field::named(of.strip_suffix(" of found")?)?;
    of_median(name, log, own().filter(|row| found(&row.record)).filter_map(|row| value(row, field)).collect())
}

/// A statistic of values, or an end of the interval of their median.
fn of_median(name: &str, log: &Log, mut values: Vec<f64>) -> Option<Option<f64>> {
    let interval = |values: &mut [f64]| proportion::median_interval(proportion::is_trajectory(&log.header), values);
    match name {
        "median-low" => Some(interval(&mut values).map(|ends| ends.0)),
        "median-high" => Some(interval(&mut values).map(|ends| ends.1)),
        _ => statistic(name, values),
    }
}

/// The value of a quantity of fix intervals: `count`, `seconds`, `path-length`, drift or amplitude.
fn toothed(of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let steps = log.sample(span).filter(|frame| frame.navigation.is_some()).map(|frame| frame.step.as_ref());
    let fix_intervals = fix_intervals(steps);
    let sum = |what: fn(&FixInterval) -> f64| fix_intervals.iter().map(what).sum::<f64>();
    let drift = sum(|fix_interval| fix_interval.drift);
    Some(match of {
        "count" => Some(fix_intervals.len() as f64),
        "seconds" => Some(sum(|fix_interval| fix_interval.seconds)),
        "path-length" => Some(sum(|fix_interval| fix_interval.path_length)),
        "drift-per-metre" => {
            Some(drift / sum(|fix_interval| fix_interval.path_length)).filter(|drift| drift.is_finite())
        }
        "smallest-drift-per-metre" | "largest-drift-per-metre" => {
            let each = fix_intervals.iter().map(|fix_interval| fix_interval.drift / fix_interval.path_length);
            each.filter(|drift| drift.is_finite()).reduce(if of.starts_with("smallest") { f64::min } else { f64::max })
        }
        "drift-per-second" => Some(drift / sum(|fix_interval| fix_interval.seconds)).filter(|drift| drift.is_finite()),
        _ => {
            let name = of.strip_suffix(" amplitude")?;
            statistic(name, fix_intervals.iter().map(|fix_interval| fix_interval.amplitude).collect())?
        }
    })
}

/// The area under the recall curve up to `bound` (%), summed over its steps.
///
/// The result is `None` where a fix has no error.
fn area<'a>(attempts: impl Iterator<Item = &'a TargetRecord>, field: Field, bound: f64) -> Option<f64> {
    let attempts: Vec<&TargetRecord> = attempts.collect();
    if attempts.is_empty() || attempts.iter().any(|row| found(row) && field.of(row).is_none()) {
        return None;
    }
    let mut errors: Vec<f64> = attempts.iter().map(|row| error(row, field).min(bound)).collect();
    errors.sort_by(f64::total_cmp);
    errors.push(bound);
    let steps = errors.windows(2).enumerate().map(|(below, two)| (below + 1) as f64 * (two[1] - two[0]));
    Some(100.0 * steps.sum::<f64>() / (attempts.len() as f64 * bound))
}

fn at(log: &Log, span: [u64; 2]) -> Option<&Seen> {
    log.at(span[0]).next()
}

fn stage(times: &FrameTimes, name: &str) -> Option<f64> {
    match name {
        "detect_ms" => times.detect_ms,
        "locate_ms" => times.locate_ms,
        "describe_ms" => times.describe_ms,
        "match_ms" => times.match_ms,
        "refine_ms" => times.refine_ms,
        "triangulate_ms" => times.triangulate_ms,
        "odometry_ms" => times.odometry_ms,
        _ => None,
    }
}

fn statistic(name: &str, mut values: Vec<f64>) -> Option<Option<f64>> {
    let n = values.len();
    let known = n > 0;
    Some(match name {
        "sampled" => Some(n as f64),
        "last" => values.last().copied(),
        "greatest" => values.iter().copied().reduce(f64::max),
        "mean" => known.then(|| values.iter().sum::<f64>() / n as f64),
        "median" => known.then(|| quantile(&mut values, 0.5)),
        _ => {
            let p: f64 = name.strip_prefix('q')?.parse().ok()?;
            known.then(|| quantile(&mut values, p / 100.0))
        }
    })
}

/// RMS errors, bounds and NEES over all frames, logged or not.
fn totals(which: &str, of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let totals = log.totals.as_ref()?;
    let rms = |squares: f64| (squares / totals.judged as f64).sqrt();
    let [tre, tre_crlb, position, position_crlb] =
        [totals.tre_squares, totals.tre_crlb_squares, totals.position_squares, totals.position_crlb_squares].map(rms);
    let nees = totals.nees_count as f64;
    Some(Some(match (which, of.strip_suffix(" of judged")?) {
        ("rms", "tre_rms") => tre,
        ("rms", "position_error") => position,
        ("bound", "tre_crlb") => tre_crlb,
        ("bound", "position_crlb") => position_crlb,
        ("ratio", "tre_rms") => tre / tre_crlb,
        ("ratio", "position_error") => position / position_crlb,
        ("ratio-low" | "ratio-high", what @ ("position_error" | "tre_rms")) => {
            let (rms, bound) = if what == "tre_rms" { (tre, tre_crlb) } else { (position, position_crlb) };
            let field = Field::named(what)?;
            let fixes = log.sample(span).flat_map(|frame| &frame.rows).filter(|row| row.record.outcome == Outcome::Fix);
            let errors: Vec<f64> = fixes.filter_map(|row| field.of(&row.record)).collect();
            let trajectory = proportion::is_trajectory(&log.header);
            let Some((low, high)) = rms::over_fixes(rms, totals.judged, trajectory, &errors) else {
                return Some(None);
            };
            (if which == "ratio-low" { low } else { high }) / bound
        }
        ("mean", "nees") => totals.nees_sum / nees,
        ("within", "nees") => totals.nees_within as f64 / nees,
        _ => return None,
    }))
}

/// The value of `FIELD of OBJECT at FRAME`.
fn single(of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let (field, rest) = of.split_once(" of ")?;
    let (object, number) = rest.rsplit_once(" at ")?;
    let number: u64 = number.parse().ok()?;
    let frame = log.at(span[0]).find(|frame| frame.number == number)?;
    if let Some(quantity) = NavigationQuantity::named(field) {
        return Some(quantity.of(frame.navigation.as_deref()?));
    }
    let field = Field::named(field)?;
    let row = frame.rows.iter().find(|row| row.record.object == object)?;
    Some(value(row, field))
}

/// One coordinate of `truth of  at FRAME` or `fix of OBJECT at FRAME`.
fn located(axis: &str, of: &str, span: [u64; 2], log: &Log) -> Option<Option<f64>> {
    let axis = ["place-x", "place-y", "place-z"].iter().position(|name| *name == axis)?;
    let (what, rest) = of.split_once(" of ")?;
    let object = rest.rsplit_once(" at ")?.0;
    let frame = at(log, span)?;
    Some(match what {
        "truth" => Some(frame.truth?[axis]),
        "navigated" => Some(frame.carried[0][axis]),
        "odometry" => Some(frame.carried[1][axis]),
        _ => Some(frame.rows.iter().find(|row| row.record.object == object)?.at[axis]),
    })
}

/// A statistic of paired logs, first and second alternating.
fn compared(what: &str, over: &str, logs: &[&Log], span: [u64; 2]) -> Option<Option<f64>> {
    let conditions = over.starts_with("conditions");
    if what == "holm" {
        let size: usize = over.rsplit(' ').next()?.parse().ok()?;
        let raw = logs.chunks(size.max(2)).map(|logs| once(logs, span, conditions).1.p);
        return Some(holm(&raw.collect::<Vec<_>>()).first().copied());
    }
    if what == "margin" {
        // The larger absolute end of the 90 % interval.
        let pairs = if conditions { medians(logs, span) } else { errors(logs[0], logs[1], span) };
        let margin = Statistics::margin(&pairs, conditions);
        return Some(Some(if conditions { margin.exp() } else { margin * 1e3 }));
    }
    let known = once(logs, span, conditions);
    let (pairs, statistics) = &*known;
    let real = |value: f64| if conditions { value.exp() } else { value * 1e3 };
    Some(Some(match what {
        "pairs" => *pairs as f64,
        "difference" => real(statistics.difference),
        "difference-low" => real(statistics.interval.0),
        "difference-high" => real(statistics.interval.1),
        "effect" => statistics.effect,
        "alone-first" => statistics.alone[0] as f64,
        "alone-second" => statistics.alone[1] as f64,
        "mcnemar" => mcnemar(statistics.alone[0], statistics.alone[1]),
        _ => return None,
    }))
}

/// A difference of the rates of fixes (points), or of a quantity of the fixes of both, over the common attempts of
/// paired logs, first and second alternating.
fn in_pairs(which: &str, what: &str, logs: &[&Log], span: [u64; 2]) -> Option<f64> {
    let trajectory = logs.iter().any(|log| proportion::is_trajectory(&log.header));
    let field = Field::named(what);
    let of = |record: &TargetRecord, is_fix: bool| match field {
        None => Some(f64::from(u8::from(is_fix))),
        // The effort of a search counts without a fix too.
        Some(field) => field.of(record).filter(|_| is_fix || field == Field::Tests),
    };
    let keyed = |log: &Log| -> BTreeMap<(u64, String), Option<f64>> {
        let rows = log.sample(span).flat_map(|frame| frame.rows.iter().map(move |row| (frame.number, row)));
        rows.map(|(number, row)| ((number, row.record.object.clone()), of(&row.record, found(&row.record)))).collect()
    };
    let paired = |logs: &[&Log]| -> Vec<(f64, f64)> {
        let theirs = keyed(logs[1]);
        keyed(logs[0]).into_iter().filter_map(|(key, own)| Some((own?, (*theirs.get(&key)?)?))).collect()
    };
    let pairs: Vec<(f64, f64)> = logs.chunks_exact(2).flat_map(paired).collect();
    let block = proportion::block(trajectory, pairs.len());
    let (difference, scale) = match field {
        None => {
            let events: Vec<(bool, bool)> = pairs.iter().map(|(a, b)| (*a > 0.5, *b > 0.5)).collect();
            (Difference::of_rates(&events, block, 0.95), 100.0)
        }
        Some(_) => (Difference::of_values(&pairs, block, 0.95)?, 1.0),
    };
    Some(match which {
        "pairs" => pairs.len() as f64,
        "difference" => scale * difference.value,
        "difference-low" => scale * difference.interval[0],
        "difference-high" => scale * difference.interval[1],
        _ => return None,
    })
}

/// The number of pairs and their statistics, resampled once for all numbers of a comparison.
fn once(logs: &[&Log], span: [u64; 2], conditions: bool) -> Rc<(usize, Statistics)> {
    let trials: Vec<&str> = logs.iter().map(|log| log.header.trial.as_str()).collect();
    let name = format!("{conditions} {span:?} {trials:?}");
    if let Some(known) = logs[0].compared.borrow().get(&name) {
        return Rc::clone(known);
    }
    let pairs = if conditions { medians(logs, span) } else { errors(logs[0], logs[1], span) };
    let known = Rc::new((pairs.len(), Statistics::of(&pairs, conditions)));
    logs[0].compared.borrow_mut().insert(name, Rc::clone(&known));
    known
}

fn errors(first: &Log, second: &Log, span: [u64; 2]) -> Vec<(f64, f64)> {
    let of = |log: &Log| -> BTreeMap<(u64, String), f64> {
        let rows = log.sample(span).flat_map(|frame| frame.rows.iter().map(move |row| (frame.number, row)));
        rows.map(|(number, row)| ((number, row.record.object.clone()), error(&row.record, Field::Tre))).collect()
    };
    let second = of(second);
    of(first).into_iter().filter_map(|(key, error)| Some((error, *second.get(&key)?))).collect()
}

/// The logarithms of the median TRE over all attempts, by pairs of logs.
fn medians(logs: &[&Log], span: [u64; 2]) -> Vec<(f64, f64)> {
    let of = |log: &Log| {
        let all = answer("all tre_rms of attempted", span, &[log]).flatten();
        all.unwrap_or(f64::INFINITY).ln()
    };
    logs.chunks_exact(2).map(|pair| (of(pair[0]), of(pair[1]))).collect()
}
