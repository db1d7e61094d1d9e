//! Counts, rates and their intervals, computed from the logs.

use seafix_log::{Outcome, Region, TargetRecord};

use crate::{
    field::Field,
    paired, proportion,
    verify::{
        logs::{Log, Row},
        rows::{error, found, rows},
    },
};

/// The number of events, their fraction (%), or an end of its interval; `None` for a fraction of none.
pub(super) fn end_of(which: &str, log: &Log, events: &[bool]) -> Option<f64> {
    let rate = proportion::rate(proportion::is_trajectory(&log.header), events);
    match which {
        "count" => Some(events.len() as f64),
        "percent" => rate.map(|rate| rate[0]),
        "low" => rate.map(|rate| rate[1]),
        _ => rate.map(|rate| rate[2]),
    }
}

/// The number of attempts or frames of `group` in all logs together.
pub(super) fn pooled(logs: &[&Log], group: &str, span: [u64; 2]) -> Option<usize> {
    logs.iter().map(|log| counted(log, group, span)).sum()
}

fn counted(log: &Log, group: &str, span: [u64; 2]) -> Option<usize> {
    if let Some(region) = Region::ALL.into_iter().find(|region| region.name() == group) {
        return Some(match log.totals.as_ref().and_then(|totals| totals.regions) {
            Some(counts) => counts[region as usize] as usize,
            None => rows(log, span).filter(|row| inside(region, &row.record)).count(),
        });
    }
    if let Some(totals) = &log.totals {
        let n = match group {
            "frames" => totals.frames,
            "fixed-frames" => totals.fix_frames,
            "wrong-frames" => totals.wrong_frames,
            "attempted" => totals.attempted,
            "found" => totals.found,
            "wrong" => totals.wrong,
            "unjudged" => totals.unjudged,
            "refused" => totals.rejected(),
            "judged" => totals.judged,
            _ => totals.reasons.get(group.strip_prefix("refused:")?).copied().unwrap_or(0),
        };
        return usize::try_from(n).ok();
    }
    let is = |of: fn(&TargetRecord) -> bool| rows(log, span).filter(|row| of(&row.record)).count();
    let frames =
        |of: fn(&TargetRecord) -> bool| log.sample(span).filter(|f| f.rows.iter().any(|row| of(&row.record))).count();
    let fixed = |row: &TargetRecord| row.outcome == Outcome::Fix;
    let wrong = |row: &TargetRecord| row.outcome == Outcome::Fix && row.evaluation.wrong == Some(true);
    Some(match group {
        "frames" => log.sample(span).count(),
        "fixed-frames" => frames(fixed),
        "wrong-frames" => frames(wrong),
        "attempted" => rows(log, span).count(),
        "found" => is(found),
        "wrong" => is(wrong),
        "unjudged" => is(|row| found(row) && row.evaluation.wrong.is_none()),
        "refused" => is(|row| row.outcome != Outcome::Fix),
        _ => {
            let reason = group.strip_prefix("refused:")?;
            let of = |row: &Row| {
                if row.record.reason.is_empty() {
                    row.record.outcome.name() == reason
                } else {
                    row.record.reason == reason
                }
            };
            rows(log, span).filter(|row| row.record.outcome != Outcome::Fix && of(row)).count()
        }
    })
}

/// Whether a fix is in a region of the Stanford diagram, by the region's definition.
fn inside(region: Region, row: &TargetRecord) -> bool {
    let values = [Field::Position, Field::Level, Field::Limit].map(|field| field.of(row));
    let [Some(e), p, Some(a)] = values.map(|value| value.filter(|_| row.outcome == Outcome::Fix)) else {
        return false;
    };
    match (region, p) {
        (Region::Unprotected, p) => p.is_none(),
        (Region::Available, Some(p)) => e <= p && p <= a,
        (Region::Misleading, Some(p)) => p < e && e <= a,
        (Region::Hazardous, Some(p)) => p <= a && a < e,
        (Region::Unavailable, Some(p)) => a < p && e <= p,
        (Region::UnavailableMisleading, Some(p)) => a < p && p < e,
        (_, None) => false,
    }
}

/// The fraction of a group (%), among attempts or fixes, or an end of its interval.
pub(super) fn fraction_of(which: &str, group: &str, scale: f64, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let fixes = group.strip_suffix(" of fixes");
    let group = fixes.or_else(|| group.strip_suffix(" of attempted"))?;
    let all = || logs.iter().flat_map(|log| rows(log, span));
    let trajectory = logs.iter().any(|log| proportion::is_trajectory(&log.header));
    let sharing = if logs.len() > 1 { paired::sharing(logs.iter().map(|log| &log.header)) } else { 1 };
    let thinned = logs.iter().any(|log| log.totals.as_ref().is_some_and(|totals| totals.every > 1));
    let known = |events: Vec<bool>| {
        let percent = 100.0 * events.iter().filter(|event| **event).count() as f64 / events.len() as f64;
        (!events.is_empty()).then(|| match which {
            "percent" => percent,
            "low" => 100.0 * proportion::interval(trajectory, &events).0,
            _ => 100.0 * proportion::interval(trajectory, &events).1,
        })
    };
    if let Some((field, bound)) = group.split_once("<=") {
        let wrong = field.strip_prefix("wrong ");
        let (field, bound) = (Field::named(wrong.unwrap_or(field))?, bound.parse::<f64>().ok()? / scale);
        if wrong.is_some() {
            let is = |row: &TargetRecord| is_wrong(row) && field.of(row).is_some_and(|value| value <= bound);
            return Some(known(all().map(|row| is(&row.record)).collect()));
        }
        if fixes.is_some() {
            let own = all().filter(|row| row.record.outcome == Outcome::Fix);
            return Some(known(own.filter_map(|row| field.of(&row.record)).map(|value| value <= bound).collect()));
        }
        let errors: Vec<f64> = all().map(|row| error(&row.record, field)).collect();
        if which != "percent" {
            // An end of a band depends on the intervals at all bounds.
            let at = proportion::bounds().position(|(_, known)| known == bound)?;
            let (low, high) = proportion::band(trajectory, &errors)[at];
            return Some((!errors.is_empty()).then_some(100.0 * if which == "low" { low } else { high }));
        }
        return Some(known(errors.into_iter().map(|error| error <= bound).collect()));
    }
    if which != "percent" && trajectory && !thinned && sharing == 1 {
        let region = Region::ALL.into_iter().find(|region| region.name() == group);
        let is = |row: &TargetRecord| match (group, region) {
            ("found", _) => found(row),
            ("refused", _) => row.outcome != Outcome::Fix,
            ("wrong", _) => row.outcome == Outcome::Fix && !found(row),
            (_, region) => region.is_some_and(|region| inside(region, row)),
        };
        return Some(known(all().map(|row| is(&row.record)).collect()));
    }
    let (k, n) = (pooled(logs, group, span)?, pooled(logs, "attempted", span)?);
    let (low, high) = proportion::interval_of_shared(trajectory, sharing, k, n);
    let value = match which {
        "percent" => 100.0 * k as f64 / n as f64,
        "low" => 100.0 * low,
        _ => 100.0 * high,
    };
    Some((n > 0).then_some(value))
}

/// A class of the reliability diagram: `count`, `mean`, `percent` (wrong), `low` or `high` of `p_wrong from A to B of
/// fixes`.
pub(super) fn class(which: &str, range: &str, span: [u64; 2], logs: &[&Log]) -> Option<Option<f64>> {
    let (from, to) = range.strip_prefix("p_wrong from ")?.strip_suffix(" of fixes")?.split_once(" to ")?;
    let (from, to): (f64, f64) = (from.parse().ok()?, to.parse().ok()?);
    let inside = |p: f64| (from == 0.0 || p > from) && p <= to;
    let fixes = logs.iter().flat_map(|log| rows(log, span)).filter(|row| row.record.outcome == Outcome::Fix);
    let fixes = fixes.filter(|row| is_wrong(&row.record) || found(&row.record));
    let own: Vec<(f64, bool)> = fixes
        .filter_map(|row| Some((Field::PWrong.of(&row.record).filter(|p| inside(*p))?, is_wrong(&row.record))))
        .collect();
    let events: Vec<bool> = own.iter().map(|(_, wrong)| *wrong).collect();
    let (low, high) = proportion::interval(false, &events);
    Some((!own.is_empty()).then(|| match which {
        "count" => own.len() as f64,
        "mean" => own.iter().map(|(p, _)| p).sum::<f64>() / own.len() as f64,
        "percent" => 100.0 * events.iter().filter(|wrong| **wrong).count() as f64 / own.len() as f64,
        "low" => 100.0 * low,
        _ => 100.0 * high,
    }))
}

fn is_wrong(row: &TargetRecord) -> bool {
    row.outcome == Outcome::Fix && row.evaluation.wrong == Some(true)
}

/// A column of the NEES histogram: the value of `nees from A to B of found`.
pub(super) fn histogram(which: &str, range: &str, span: [u64; 2], logs: &[&Log]) -> Option<f64> {
    let (from, to) = range.strip_prefix("nees from ")?.strip_suffix(" of found")?.split_once(" to ")?;
    let (from, to): (f64, f64) = (from.parse().ok()?, to.parse().ok()?);
    let found = logs.iter().flat_map(|log| rows(log, span)).filter(|row| found(&row.record));
    let all: Vec<f64> = found.filter_map(|row| row.record.evaluation.nees).collect();
    let inside = all.iter().filter(|nees| **nees >= from && **nees < to).count();
    // The last column is plotted with the width of the others.
    let width = if to.is_finite() { to - from } else { 1.5 };
    Some(if which == "count" { inside as f64 } else { inside as f64 / all.len() as f64 / width })
}
