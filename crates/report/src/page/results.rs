//! The tables of results.

use maud::{Markup, html};

use super::{distinct, figures, limits};
use crate::{
    PAPER_M1, Row, Spread, Summary,
    format::{decimals, headed, interval, number, percent},
    run::Run,
};

pub(super) fn section(run: &Run, summary: &Summary) -> Markup {
    html! {
        h2 { "Results" }
        (outcomes(summary))
        (errors(summary))
        @if limits::known(summary) { (limits::section(summary)) } @else { (figures::errors(run, summary)) }
        (refusals(summary))
        (times(summary))
    }
}

/// Heads of the columns that say which trial a row is.
pub(super) fn heads(summary: &Summary) -> Vec<String> {
    let conditions = summary.rows.first().into_iter().flat_map(Row::conditions);
    ["Method".to_owned()].into_iter().chain(conditions.map(|axis| headed(&axis.key))).collect()
}

/// The cells that say which trial `row` is.
pub(super) fn cells(row: &Row) -> Markup {
    html! {
        td.nowrap { (row.method()) }
        @for axis in row.conditions() {
            td.n[axis.value.parse::<f64>().is_ok()] { (axis.value) }
        }
    }
}

/// Whether a thin line goes above row `index`: where the first condition changes.
pub(super) fn breaks(summary: &Summary, index: usize) -> bool {
    let first = |index: usize| summary.rows[index].conditions().next().map(|axis| &axis.value);
    index > 0 && first(index) != first(index - 1)
}

fn outcomes(summary: &Summary) -> Markup {
    html! {
        figure.table {
            figcaption {
                "Outcomes. n: targets attempted, one a frame and target in view of the prior; rates in % of n with exact 95 % intervals. "
                "Frames: with at least one fix, and with a wrong one, of all frames. Points: median number identified."
            }
            table {
                thead {
                    tr {
                        @for _ in heads(summary) { th {} } th {}
                        th.group colspan="2" { span { "Found" } } th.group colspan="2" { span { "Refused" } }
                        th.group colspan="2" { span { "Wrong" } } th.group colspan="2" { span { "Frames" } } th {}
                    }
                    tr {
                        @for head in heads(summary) { th { (head) } } th.n { "n" }
                        @for _ in 0..3 { th.n { "%" } th.n { "interval" } }
                        th.n { "fixed" } th.n { "wrong" } th.n { "Points" }
                    }
                }
                tbody {
                    @for (index, row) in summary.rows.iter().enumerate() {
                        tr.break[breaks(summary, index)] {
                            (cells(row)) td.n { (row.attempted) }
                            @for count in [row.found, row.refused, row.wrong] {
                                td.n { (percent(count, row.attempted)) } td.n.ci { (interval(count, row.attempted)) }
                            }
                            td.n { (row.referenced_frames) "/" (row.frames) } td.n { (row.wrong_frames) }
                            td.n { (number(row.identified.map(|spread| spread.median), 0)) }
                        }
                    }
                }
            }
        }
    }
}

/// One quantity of the table of errors.
struct Column {
    name: &'static str,
    value: fn(&Row) -> Option<Spread>,
    scale: f64,
}

fn errors(summary: &Summary) -> Markup {
    let columns = [
        Column { name: "m1 (mm)", value: |row| row.m1, scale: 1e3 },
        Column { name: "m1 unused (mm)", value: |row| row.m1_unused, scale: 1e3 },
        Column { name: "m2 (mm)", value: |row| row.m2, scale: 1e3 },
        Column { name: "m3 position (mm)", value: |row| row.m3_position, scale: 1e3 },
        Column { name: "m3 attitude (°)", value: |row| row.m3_attitude, scale: 1f64.to_degrees() },
    ];
    let digits = columns.each_ref().map(|column| {
        decimals(summary.rows.iter().filter_map(|row| (column.value)(row)).map(|spread| spread.median * column.scale))
    });
    let all_digits = decimals(summary.rows.iter().filter_map(|row| row.m2_of_all).map(|m2| m2 * 1e3));
    html! {
        figure.table.wide {
            figcaption {
                "Errors of the fixes found: median and 95 % quantile over n fixes. "
                i { "All" } ": median of m2 over all attempts, refused and wrong ones counted as infinitely far off. "
                "Best values are not marked: with few frames a trial no difference is claimed to be significant."
            }
            table {
                thead {
                    tr {
                        @for _ in heads(summary) { th {} } th {}
                        @for column in &columns { th.group colspan="2" { span { (column.name) } } }
                        th {} th {}
                    }
                    tr {
                        @for head in heads(summary) { th { (head) } } th.n { "n" }
                        @for _ in &columns { th.n { "median" } th.n { "p95" } }
                        th.n { "m2 all (mm)" } th.n { "NEES mean" }
                    }
                }
                tbody {
                    @for (index, row) in summary.rows.iter().enumerate() {
                        tr.break[breaks(summary, index)] {
                            (cells(row)) td.n { (row.found) }
                            @for (column, &digits) in columns.iter().zip(&digits) {
                                @let spread = (column.value)(row);
                                td.n { (number(spread.map(|s| s.median * column.scale), digits)) }
                                td.n.minor { (number(spread.map(|s| s.p95 * column.scale), digits)) }
                            }
                            td.n { (number(row.m2_of_all.map(|m2| m2 * 1e3), all_digits)) }
                            td.n { (number(row.nees_mean, 2)) }
                        }
                    }
                    tr.reference {
                        td { "The paper" }
                        @for _ in 1..heads(summary).len() { td.n { "" } }
                        td.n { "–" }
                        td.n colspan="2" { (number(Some(PAPER_M1[0] * 1e3), 0)) "–" (number(Some(PAPER_M1[1] * 1e3), 0)) }
                        td.minor colspan="10" { "virtual scene, three points, 2–5 m; nothing else reported" }
                    }
                }
            }
        }
    }
}

fn refusals(summary: &Summary) -> Markup {
    let reasons = distinct({
        let mut all: Vec<String> = summary.rows.iter().flat_map(|row| row.reasons.keys().cloned()).collect();
        all.sort();
        all
    });
    html! {
        @if reasons.is_empty() {
            p { "No attempt was refused." }
        } @else {
            figure.table {
                figcaption { "Refused attempts by reason, out of n." }
                table {
                    thead { tr {
                        @for head in heads(summary) { th { (head) } } th.n { "n" }
                        @for reason in &reasons { th.n { (reason) } } th.n { "all" }
                    } }
                    tbody {
                        @for (index, row) in summary.rows.iter().enumerate() {
                            tr.break[breaks(summary, index)] {
                                (cells(row)) td.n { (row.attempted) }
                                @for reason in &reasons { td.n { (row.reasons.get(reason).copied().unwrap_or(0)) } }
                                td.n { (row.refused) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn times(summary: &Summary) -> Markup {
    let stages = summary.rows.first().map(|row| row.times.stages().map(|(stage, _)| stage));
    html! {
        figure.table {
            figcaption {
                "Time (ms), medians: of the first six stages a frame, of the others an attempted target; "
                i { "total" } " is from the images, or the points where there are none, to the answer about one target."
            }
            table {
                thead { tr {
                    @for head in heads(summary) { th { (head) } }
                    @for stage in stages.into_iter().flatten() { th.n { (stage) } }
                } }
                tbody {
                    @for (index, row) in summary.rows.iter().enumerate() {
                        tr.break[breaks(summary, index)] {
                            (cells(row))
                            @for (_, time) in row.times.stages() { td.n { (number(time, if time.is_some_and(|t| t < 1.0) { 3 } else { 1 })) } }
                        }
                    }
                }
            }
        }
    }
}
