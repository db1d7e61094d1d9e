//! The abstract: the question and its answer in numbers.

use maud::{Markup, html};

use super::distinct;
use crate::{
    PAPER_M1, Row, Spread, Summary,
    format::{counted, decimals, interval, number, percent},
    paper,
    run::Run,
};

pub(super) fn section(run: &Run, summary: &Summary) -> Markup {
    let total = |count: fn(&Row) -> usize| summary.rows.iter().map(count).sum::<usize>();
    let (attempted, found, refused, wrong) =
        (total(|row| row.attempted), total(|row| row.found), total(|row| row.refused), total(|row| row.wrong));
    // Trials may share their frames, and then they are no independent draws: the counts of several carry
    // no interval.
    let one = run.trials.len() == 1;
    let share = |k: usize| {
        html! {
            (k) " (" (percent(k, attempted)) " %"
            @if one { ", 95 % interval " (interval(k, attempted)) }
            ")"
        }
    };
    let methods = distinct(summary.rows.iter().map(Row::method));
    html! {
        section.abstract {
            p.question { (run.header().question) }
            p {
                "In " (counted(run.trials.len(), "trial", "trials")) " with "
                (counted(total(|row| row.frames), "frame", "frames")) ", "
                (counted(attempted, "target", "targets")) " were attempted: "
                (share(found)) " found, " (share(refused)) " refused, " (share(wrong)) " wrong."
                @if !one {
                    " These counts pool trials that may share their frames; intervals stand with each trial below."
                }
                @if total(|row| row.unjudged) > 0 {
                    " No truth judges " (total(|row| row.unjudged)) " of the fixes found."
                }
                @for method in &methods {
                    @let rows: Vec<&Row> = summary.rows.iter().filter(|row| row.method() == *method).collect();
                    " " (sentence(method, &rows))
                }
                " The paper reports m1 of " (number(Some(PAPER_M1[0] * 1e3), 0)) "–" (number(Some(PAPER_M1[1] * 1e3), 0))
                " mm in its virtual scene at 2–5 m, and neither rates nor the error of the vehicle’s pose (" (paper::CITATION) ")."
            }
        }
    }
}

/// The medians of one method over its trials.
fn sentence(method: &str, rows: &[&Row]) -> Markup {
    let range = |value: fn(&Row) -> Option<Spread>, scale: f64| {
        let medians: Vec<f64> = rows.iter().filter_map(|row| value(row)).map(|spread| spread.median * scale).collect();
        let digits = decimals(medians.iter().copied());
        let [low, high] = medians.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &m| [a.min(m), b.max(m)]);
        (!medians.is_empty()).then(|| {
            let (low, high) = (number(Some(low), digits), number(Some(high), digits));
            if low == high { low } else { format!("{low} to {high}") }
        })
    };
    let m1 = range(|row| row.m1, 1e3);
    let m2 = range(|row| row.m2, 1e3);
    let position = range(|row| row.m3_position, 1e3);
    let attitude = range(|row| row.m3_attitude, 1f64.to_degrees());
    html! {
        @if let Some(m1) = m1 {
            "With " (method) " the medians of the fixes found are m1 " (m1) " mm"
            @if let Some(m2) = m2 { ", m2 " (m2) " mm" }
            @if let (Some(position), Some(attitude)) = (position, attitude) {
                ", camera position " (position) " mm and attitude " (attitude) "°"
            }
            "."
        }
    }
}
