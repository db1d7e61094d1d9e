//! What was compared: the pipeline, stage by stage, and what the metrics mean.

use maud::{Markup, html};
use seafix_log::Component;

use super::distinct;
use crate::run::{Run, Trial};

pub(super) fn section(run: &Run) -> Markup {
    let components: Vec<&Component> = run.trials.iter().flat_map(components).collect();
    let images = run.trials.iter().any(|trial| trial.images);
    let points = run.trials.iter().any(|trial| !trial.images);
    let stages = distinct(components.iter().map(|component| component.stage.clone()));
    let mut rows: Vec<(bool, &Component)> = Vec::new();
    for stage in &stages {
        let mut first = true;
        for component in components.iter().filter(|component| component.stage == *stage) {
            if !rows.iter().any(|(_, known)| known == component) {
                rows.push((first, component));
                first = false;
            }
        }
    }
    html! {
        h2 { "Method" }
        p {
            @if images {
                "Corners of both images are described, matched and triangulated into a cloud"
                @if points { "; where the source gives no images, the cloud comes from it as it is" }
            } @else {
                "The source gives no images, so nothing is detected, described or matched: the cloud comes from it as it is"
            }
            "; for each target, the prior selects candidates, the search finds the largest structurally coherent set among them, and the solver "
            "computes the pose " i { "H" } " that carries its points " i { "C" } " onto the model’s points " i { "P" }
            ". An attempt that fails a test is refused with its reason."
        }
        figure.table {
            figcaption { "The pipeline. Several lines of one stage are the alternatives compared." }
            table {
                thead { tr { th { "Stage" } th { "Component" } th { "What it does, and its settings" } } }
                tbody {
                    @for (first, component) in rows {
                        tr.break[first] {
                            td { @if first { (component.stage) } }
                            td.nowrap { (component.name) }
                            td.text {
                                (component.summary)
                                @if !component.source.is_empty() { " " span.minor { "(" (component.source) ")" } }
                                @if !component.settings.is_empty() { br; }
                                @for (index, (key, value)) in component.settings.iter().enumerate() {
                                    @if index > 0 { ", " }
                                    code.nowrap { (key) " = " (value) }
                                }
                            }
                        }
                    }
                }
            }
        }
        p { "Metrics, fixed beforehand; medians and quantiles are over the fixes found, and refusals never leave the denominator of a rate:" }
        dl {
            dt { "found, refused, wrong" }
            dd { "A fix is wrong when m2 exceeds the alert limit (the smaller of 0.10 m and 5 % of the target’s diameter); an attempt without a fix is refused; all others are found. The rates of a trial carry exact (Clopper–Pearson) 95 % intervals." }
            dt { "m1" }
            dd { "RMS of ‖" i { "H" } "·" i { "C" } " − " i { "P" } "‖ over the correctly identified points: the paper’s figure. It contains the evaluated points’ own noise; " i { "unused" } " leaves out those the solver used." }
            dt { "m2" }
            dd { "RMS of ‖" i { "E" } "·" i { "p" } " − " i { "p" } "‖ over all model points " i { "p" } " of the target, " i { "E" } " the estimated after the inverse true pose." }
            dt { "m3" }
            dd { "Error of the left camera’s position in the frame of the target, and the rotation angle of " i { "E" } "." }
            dt { "NEES" }
            dd { "Squared error of the pose by its own covariance; its mean is 6 where the covariance is honest." }
        }
    }
}

/// The components that did some work in `trial`: those that see images only where there were images.
fn components(trial: &Trial) -> impl Iterator<Item = &Component> {
    let sees =
        |component: &Component| matches!(&component.stage[..], "detector" | "descriptor" | "matcher" | "locator");
    trial.header.components.iter().filter(move |component| trial.images || !sees(component))
}
