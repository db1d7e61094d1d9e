//! What the methods were given.

use maud::{Markup, html};
use seafix_log::{CameraRecord, TrialHeader};

use super::distinct;
use crate::{
    Summary,
    format::{counted, number},
    run::Run,
};

pub(super) fn section(run: &Run, summary: &Summary) -> Markup {
    let of = |say: fn(&TrialHeader) -> String| distinct(run.trials.iter().map(|trial| say(&trial.header))).join("; ");
    let frames = distinct(run.trials.iter().map(|trial| counted(trial.count(), "frame", "frames"))).join(", ");
    let measured: Vec<f64> = summary.rows.iter().filter_map(|row| row.disparity_sigma).collect();
    let measured = measured.iter().fold([f64::INFINITY, 0.0], |[a, b], &s| [s.min(a), s.max(b)]);
    html! {
        h2 { "Data" }
        figure.table {
            figcaption { "Conditions of the run. Where trials differ, all values stand side by side." }
            table {
                tbody {
                    (line("Source", &of(|header| header.source.clone())))
                    (line("Frames", &format!("{frames} a trial, {} in all", counted(run.trials.len(), "trial", "trials"))))
                    (line("Targets", &of(targets)))
                    (line("Left camera", &of(|header| camera(&header.rig.left))))
                    (line("Right camera", &of(|header| camera(&header.rig.right))))
                    (line("Rig", &of(rig)))
                    (line("Prior, one σ", &of(prior)))
                    (line("Corner noise assumed", &of(|header| header.pixel_sigma.map_or("–".to_owned(), |s| format!("σ = {s} px per axis and image")))))
                    @if measured[1] > 0.0 {
                        @let [low, high] = measured.map(|sigma| number(Some(sigma), 2));
                        (line("Disparity noise measured", &format!(
                            "σ = {} px, RMS over the identified points within 2 px of truth, which truncates it; targets of several objects left out",
                            if low == high { low } else { format!("{low}–{high}") }
                        )))
                    }
                    (line("Model points", &of(|header| {
                        let sigmas = header.targets.iter().flat_map(|target| &target.points);
                        let sigmas = distinct(sigmas.map(|point| format!("{} mm", point.sigma * 1e3)));
                        format!("σ = {} per axis", sigmas.join(", "))
                    })))
                    (line("Seeds", &of(|header| header.seeds.iter().map(|(name, seed)| format!("{name} {seed}")).collect::<Vec<_>>().join(", "))))
                    (line("Versions", &of(|header| header.versions.iter().map(|(name, version)| format!("{name} {version}")).collect::<Vec<_>>().join(", "))))
                }
            }
        }
    }
}

fn line(name: &str, value: &str) -> Markup {
    html! { @if !value.is_empty() { tr { td.nowrap { i { (name) } } td.text { (value) } } } }
}

fn targets(header: &TrialHeader) -> String {
    let targets = header.targets.iter().map(|target| format!("{} ({})", target.id, target.points.len()));
    let points: usize = header.targets.iter().map(|target| target.points.len()).sum();
    format!("{}: {} feature points", targets.collect::<Vec<_>>().join(", "), points)
}

fn camera(camera: &CameraRecord) -> String {
    let k = camera.matrix;
    let distortion = if camera.distortion.iter().all(|k| *k == 0.0) { "no distortion" } else { "with distortion" };
    format!("{} × {} px, f = {:.1}, {:.1} px, {distortion}", camera.size[0], camera.size[1], k[0][0], k[1][1])
}

fn rig(header: &TrialHeader) -> String {
    let t = header.rig.right_from_left.map(|row| row[3]);
    let baseline = t[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    format!("baseline {baseline:.3} m, {}", if header.rig.rectified { "rectified" } else { "general" })
}

fn prior(header: &TrialHeader) -> String {
    match (header.prior_position_sigma, header.prior_attitude_sigma) {
        (None, None) => "none".to_owned(),
        (position, attitude) => format!(
            "{} m per world axis, {}° per camera axis",
            position.map_or("–".to_owned(), |s| s.to_string()),
            number(attitude.map(f64::to_degrees), 2)
        ),
    }
}
