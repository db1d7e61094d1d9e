//! Errors beside the Cramér–Rao bound, where every fix has one.

use maud::{Markup, html};

use super::{distinct, results};
use crate::{
    Row, Summary,
    figure::{Cell, Field, field},
    format::{decimals, headed, number, short, unit},
};

/// Whether the rows have bounds.
pub(super) fn known(summary: &Summary) -> bool {
    summary.rows.iter().any(|row| row.limits.is_some())
}

/// Figure and table.
pub(super) fn section(summary: &Summary) -> Markup {
    html! {
        @if known(summary) {
            (over_noise(summary))
            (table(summary))
        }
    }
}

/// The axis of the pixel noise, where it varies.
fn noise(summary: &Summary) -> Option<&str> {
    let axes = summary.rows.first()?.axes.iter();
    axes.map(|axis| axis.key.as_str()).find(|key| unit(key) == Some("px") && distinct(on(summary, key)).len() > 1)
}

fn on<'a>(summary: &'a Summary, key: &'a str) -> impl Iterator<Item = String> + 'a {
    summary.rows.iter().filter_map(move |row| value(row, key))
}

fn value(row: &Row, key: &str) -> Option<String> {
    row.axes.iter().find(|axis| axis.key == key).map(|axis| axis.value.clone())
}

/// Root mean square m2 over the noise, a plot for each of all other conditions.
fn over_noise(summary: &Summary) -> Markup {
    let Some(key) = noise(summary) else { return html! {} };
    let conditions = |row: &Row| -> Vec<String> {
        let others = row.conditions().filter(|axis| axis.key != key);
        others
            .map(|axis| match axis.value.parse::<f64>() {
                Ok(_) => format!(
                    "{} {}{}",
                    short(&axis.key),
                    axis.value,
                    unit(&axis.key).map(|u| format!(" {u}")).unwrap_or_default()
                ),
                Err(_) => axis.value.clone(),
            })
            .collect()
    };
    let methods = distinct(summary.rows.iter().map(|row| row.solver.clone()));
    let mut places: Vec<Vec<String>> = Vec::new();
    for row in summary.rows.iter().filter(|row| row.limits.is_some()) {
        if !places.contains(&conditions(row)) {
            places.push(conditions(row));
        }
    }
    let cells = places.iter().map(|place| {
        let rows = || summary.rows.iter().filter(|row| conditions(row) == *place);
        let line = |take: &dyn Fn(&Row) -> Option<f64>, solver: Option<&str>| {
            let rows = rows().filter(|row| solver.is_none_or(|solver| row.solver == solver));
            let points = rows.filter_map(|row| Some([value(row, key)?.parse().ok()?, take(row)? * 1e3]));
            let mut points: Vec<[f64; 2]> = points.collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            points.dedup_by(|a, b| a[0] == b[0]);
            points
        };
        let m2 = |which: usize| move |row: &Row| row.limits.map(|limits| limits.m2[which]);
        let own = methods.iter().map(|solver| line(&m2(0), Some(solver)));
        let half = place.len().div_ceil(2);
        Cell {
            title: [place[..half].join(", "), place[half..].join(", ")],
            series: own.chain([line(&m2(1), None)]).collect(),
        }
    });
    let mut ticks: Vec<f64> = on(summary, key).filter_map(|value| value.parse().ok()).collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    let cells: Vec<Cell> = cells.collect();
    let drawn = field(&Field {
        x_label: headed(key),
        y_label: "root mean square m2 (mm)".to_owned(),
        x_ticks: ticks,
        names: methods.iter().cloned().chain(["Cramér–Rao bound".to_owned()]).collect(),
        columns: cells.len().clamp(1, 6),
        cells,
    });
    html! {
        @if let Some(drawn) = drawn {
            figure.plot.wide {
                (drawn)
                figcaption {
                    "Root mean square error of the transferred model points (m2) over the pixel noise, both axes logarithmic and shared by all plots; "
                    "over every fix of a trial, wrong ones included. Black: the Cramér–Rao bound, which no unbiased estimate betters on average."
                }
            }
        }
    }
}

fn table(summary: &Summary) -> Markup {
    let all = || summary.rows.iter().filter_map(|row| row.limits);
    let digits = [decimals(all().map(|limits| limits.m2[1] * 1e3)), decimals(all().map(|limits| limits.m3[1] * 1e3))];
    html! {
        figure.table.wide {
            figcaption {
                "Root mean squares beside the Cramér–Rao bound, over all n fixes, wrong ones included: m2, the position (m3), their ratio to the bound. "
                "NEES: mean of the normalised error squared, 6 for an honest covariance; below 95 %: share of the fixes within the χ²₆ quantile of 95 %."
            }
            table {
                thead {
                    tr {
                        @for _ in results::heads(summary) { th {} } th {}
                        @for name in ["m2 (mm)", "m3 (mm)"] { th.group colspan="3" { span { (name) } } }
                        th {} th {}
                    }
                    tr {
                        @for head in results::heads(summary) { th { (head) } } th.n { "n" }
                        @for _ in 0..2 { th.n { "RMSE" } th.n { "bound" } th.n { "ratio" } }
                        th.n { "NEES" } th.n { "below 95 %" }
                    }
                }
                tbody {
                    @for (index, row) in summary.rows.iter().enumerate() {
                        @if let Some(limits) = row.limits {
                            tr.break[results::breaks(summary, index)] {
                                (results::cells(row)) td.n { (limits.count) }
                                @for ([rmse, bound], digits) in [limits.m2, limits.m3].into_iter().zip(digits) {
                                    td.n { (number(Some(rmse * 1e3), digits)) } td.n.minor { (number(Some(bound * 1e3), digits)) }
                                    td.n { (number(Some(rmse / bound), 3)) }
                                }
                                td.n { (number(Some(limits.nees), 3)) } td.n { (number(Some(limits.coverage), 4)) }
                            }
                        }
                    }
                }
            }
        }
    }
}
