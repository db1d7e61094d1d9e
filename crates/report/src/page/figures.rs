//! The figures and their captions, conditions included.

use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};

use super::distinct;
use crate::{
    PAPER_M1, Row, Spread, Summary,
    figure::{Panel, Picture, Plot, Series, Value, plot},
    format::{counted, headed, short},
    run::{Run, Trial},
};

/// Both images of one fix.
pub(super) fn fix(run: &Run, picture: Option<&Picture>) -> Markup {
    let Some(picture) = picture else { return html! {} };
    let trial = &run.trials[picture.trial];
    let [key_points, cloud, candidates, identified, used] = picture.counts;
    let key = |drawing: &'static str| html! { svg.key viewBox="0 0 32 32" { (PreEscaped(drawing)) } };
    html! {
        figure.image.wide {
            img src={ "data:image/jpeg;base64," (STANDARD.encode(&picture.jpeg)) } width=(picture.size[0]) height=(picture.size[1])
                alt="Left and right image with key points, candidates and identified points";
            figcaption {
                "Left and right image of one fix: " (key_points) " key points of the left image and " (cloud) " matched points "
                (key(r##"<path d="M16 5v22M5 16h22" stroke="#000" stroke-width="8"/><path d="M16 6v20M6 16h20" stroke="#fff" stroke-width="4"/>"##))
                ", " (counted(candidates, "candidate", "candidates")) " "
                (key(r##"<circle cx="16" cy="16" r="10" fill="none" stroke="#56b4e9" stroke-width="4"/>"##))
                ", " (identified) " identified "
                (key(r##"<circle cx="16" cy="16" r="11" fill="#ffb000"/><circle cx="16" cy="16" r="7" fill="#000"/>"##))
                ", " (used) " used by the solver "
                (key(r##"<circle cx="16" cy="16" r="9" fill="#ffb000"/><circle cx="16" cy="16" r="6" fill="#000"/><circle cx="16" cy="16" r="13" fill="none" stroke="#e63c14" stroke-width="4"/>"##))
                ". Targets fixed: " (picture.objects.join(", ")) ". It is the frame with most identified points: frame "
                (picture.frame) " of " code { (trial.file()) } ", stamp " (picture.stamp_ns) " ns. " (conditions(run, Some(trial)))
            }
        }
    }
}

/// Camera, noise and source, in one sentence: of one trial, or of what all share.
fn conditions(run: &Run, trial: Option<&Trial>) -> Markup {
    let header = trial.map_or(run.header(), |trial| &trial.header);
    let rig = &header.rig;
    let t = rig.right_from_left.map(|row| row[3]);
    let baseline = t[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    let sources = match trial {
        Some(trial) => vec![trial.header.source.clone()],
        None => distinct(run.trials.iter().map(|trial| trial.header.source.clone())),
    };
    html! {
        "Source: " (sources.join("; ")) "; " (rig.left.size[0]) " × " (rig.left.size[1]) " px, f = "
        (format!("{:.0}", rig.left.matrix[0][0])) " px, baseline " (format!("{baseline:.2}")) " m"
        @if trial.is_none() { "; " (frames(run)) " a trial" }
        @if let Some(trial) = trial {
            @for axis in &trial.header.axes { "; " (short(&axis.key)) " " (axis.value) }
        }
        "."
    }
}

/// How many frames a trial has.
fn frames(run: &Run) -> String {
    distinct(run.trials.iter().map(|trial| counted(trial.count(), "frame", "frames"))).join(" or ")
}

/// m1 and m2 over the conditions, or over the frames where nothing but the method varies.
pub(super) fn errors(run: &Run, summary: &Summary) -> Markup {
    let axis = summary.rows.first().into_iter().flat_map(Row::conditions).find(|axis| {
        let values: Vec<Option<f64>> = summary.rows.iter().map(|row| on_axis(row, &axis.key)).collect();
        values.iter().all(Option::is_some) && values.iter().any(|value| *value != values[0])
    });
    match axis {
        Some(axis) => over_axis(run, summary, &axis.key),
        None => over_frames(run, summary),
    }
}

fn on_axis(row: &Row, key: &str) -> Option<f64> {
    row.axes.iter().find(|axis| axis.key == key).and_then(|axis| axis.value.parse().ok())
}

fn panels(series: impl Fn(fn(&Row) -> Option<Spread>) -> Vec<Series>) -> Vec<Panel> {
    let band = (PAPER_M1.map(|m| m * 1e3), "the paper, 2–5 m");
    vec![
        Panel { y_label: "m1, residual (mm)".to_owned(), band: Some(band), series: series(|row| row.m1) },
        Panel { y_label: "m2, model points (mm)".to_owned(), band: None, series: series(|row| row.m2) },
    ]
}

fn over_axis(run: &Run, summary: &Summary, key: &str) -> Markup {
    let name = |row: &Row| {
        let others = row.conditions().filter(|axis| axis.key != key);
        others.fold(row.method(), |name, axis| format!("{name}, {} {}", short(&axis.key), axis.value))
    };
    let series = |value: fn(&Row) -> Option<Spread>| {
        let names = distinct(summary.rows.iter().map(name));
        let values = |wanted: &str| {
            let rows = summary.rows.iter().filter(|row| name(row) == wanted);
            let values = rows.filter_map(|row| {
                let spread = value(row)?;
                let [y, low, high] = [spread.median, spread.p5, spread.p95].map(|m| m * 1e3);
                Some(Value { x: on_axis(row, key)?, y, low, high })
            });
            let mut values: Vec<Value> = values.collect();
            values.sort_by(|a, b| a.x.total_cmp(&b.x));
            values
        };
        names.into_iter().map(|name| Series { values: values(&name), name }).collect()
    };
    let mut ticks: Vec<f64> = summary.rows.iter().filter_map(|row| on_axis(row, key)).collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    let drawn = plot(&Plot { x_label: headed(key), x_ticks: ticks, panels: panels(series), lines: true });
    html! {
        @if let Some(drawn) = drawn {
            figure.plot {
                (drawn)
                figcaption {
                    "Error over " (short(key)) ": medians of the fixes found, bars from the 5 % to the 95 % quantile; "
                    "the shaded band is the m1 that the paper reports for its virtual scene at 2–5 m. Lines are moved apart by a few pixels. "
                    (conditions(run, None))
                }
            }
        }
    }
}

fn over_frames(run: &Run, summary: &Summary) -> Markup {
    let points = |value: fn(&seafix_log::Evaluation) -> Option<f64>| {
        let series = summary.rows.iter().zip(&run.trials).map(|(row, trial)| Series {
            name: if summary.rows.len() == 1 { row.method() } else { row.trial.clone() },
            values: trial
                .attempts()
                .filter_map(|(frame, target)| {
                    let y = value(&target.evaluation)? * 1e3;
                    Some(Value { x: frame.number as f64, y, low: y, high: y })
                })
                .collect(),
        });
        series.collect::<Vec<_>>()
    };
    let band = (PAPER_M1.map(|m| m * 1e3), "the paper, 2–5 m");
    let panels = vec![
        Panel { y_label: "m1, residual (mm)".to_owned(), band: Some(band), series: points(|fix| fix.m1_rms) },
        Panel { y_label: "m2, model points (mm)".to_owned(), band: None, series: points(|fix| fix.m2_rms) },
    ];
    let last = run.trials.iter().flat_map(|trial| &trial.frames).map(|frame| frame.number).max().unwrap_or(0);
    let step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].into_iter().find(|step| last / step <= 8).unwrap_or(5000);
    let ticks = (0..=last / step).map(|i| (i * step) as f64).collect();
    let drawn = plot(&Plot { x_label: "frame".to_owned(), x_ticks: ticks, panels, lines: false });
    html! {
        @if let Some(drawn) = drawn {
            figure.plot {
                (drawn)
                figcaption {
                    "Error of every fix over the frames; a frame without a mark gave none. The shaded band is the m1 that the paper reports for its virtual scene at 2–5 m, another scene and camera. "
                    (conditions(run, None))
                }
            }
        }
    }
}
