//! The section on the method: algorithm, formulas, coordinate frames and the stages of the pipeline.

use seafix_log::Component;

use crate::{
    document::{Block, Cell, Head, Section, Span, Table, code, italic, sub, sup, text},
    format::distinct,
    run::{Run, Trial},
};

pub(crate) fn section(run: &Run) -> Section {
    let images = run.trials.iter().any(|trial| trial.images);
    let points = run.trials.iter().any(|trial| !trial.images);
    let begin = match (images, points) {
        (true, false) => "Corners of both images are described, matched and triangulated into a cloud",
        (true, true) => {
            "Corners of both images are described, matched and triangulated into a cloud; a source without images provides the cloud itself"
        }
        _ => "The source gives no images, so no corner is detected, described or matched: it provides the cloud itself",
    };
    let named = run.trials.iter().all(|trial| trial.method()[0] == "labelled");
    let middle = match named {
        true => {
            "; every cloud point has a label, so that no search is needed, and the solver computes for each target the pose "
        }
        false => {
            "; the prior selects candidates for each target, the search finds a structurally coherent set among them, and the solver computes the pose "
        }
    };
    let [h, c, p, e] = ["H", "C", "P", "p"].map(italic);
    let algorithm = text![
        begin,
        middle,
        h.clone(),
        " that maps the cloud points ",
        c.clone(),
        " to the model points ",
        p.clone(),
        ". An attempt that fails a test is rejected with its reason."
    ];
    let coherence = text![
        "| ‖",
        p.clone(),
        sub("i"),
        " − ",
        p.clone(),
        sub("j"),
        "‖ − ‖",
        c.clone(),
        sub("k"),
        " − ",
        c.clone(),
        sub("l"),
        "‖ | ≤ Δ",
        sub("ij"),
        "   for all pairs of the set,      ",
        h.clone(),
        " = arg min Σ",
        " ρ( ",
        h,
        " ",
        c,
        sub("k"),
        " − ",
        p,
        sub("i"),
        " )",
    ];
    let frames = text![
        "Coordinate frames: the camera frame is that of the left camera, x to the right, y downwards, z forward. The object frame is right-handed with its origin in the first base point P1, x from P1 to P3, z along (P2 − P1) × (P3 − P1). ",
        "Points are columns, ",
        e.clone(),
        sub("a"),
        " = ",
        italic("T"),
        sub("ab"),
        " ",
        e,
        sub("b"),
        ". A covariance is that of ξ = (φ, ρ), rotation first, in ",
        italic("T"),
        " Exp(ξ), in the camera frame. Lengths are in metres, angles in degrees; the centre of the first pixel is (0, 0).",
    ];
    Section::new("Method").with([
        Block::Paragraph(algorithm),
        Block::Formula(coherence),
        Block::Paragraph(frames),
        Block::Table(pipeline(run)),
        Block::Paragraph(text![
            "ρ is the solver’s cost: the squared distance, the squared Mahalanobis distance, or the squared reprojection error in both images (", sup(""), "see Table 1)."
        ].into_iter().filter(|span| !span.plain().is_empty()).collect()),
    ])
}

fn pipeline(run: &Run) -> Table {
    let components: Vec<&Component> = run.trials.iter().flat_map(components).collect();
    let stages = distinct(components.iter().map(|component| component.stage.clone()));
    let heads = ["Stage", "Component", "Description and settings"].map(Head::words).to_vec();
    let caption = text!["The pipeline and its settings. Several lines of one stage are the compared alternatives."];
    let mut table = Table::new("pipeline", caption, heads);
    for stage in &stages {
        let mut known: Vec<&Component> = Vec::new();
        for component in components.iter().filter(|component| component.stage == *stage) {
            if known.contains(component) {
                continue;
            }
            let mut message = text![component.summary.clone()];
            if !component.source.is_empty() {
                message.push(format!(" ({})", component.source).into());
            }
            if !component.settings.is_empty() {
                message.push(". ".into());
            }
            for (index, (key, value)) in component.settings.iter().enumerate() {
                message.extend((index > 0).then(|| Span::from(", ")));
                message.push(code(format!("{key} = {value}")));
            }
            let first = known.is_empty();
            let stage = if first { component.stage.clone() } else { String::new() };
            table.line(first, vec![stage.into(), component.name.clone().into(), Cell::prose(message)]);
            known.push(component);
        }
    }
    table
}

/// The components in use in `trial`; those of the front end only if the trial has images.
fn components(trial: &Trial) -> impl Iterator<Item = &Component> {
    let sees =
        |component: &Component| matches!(&component.stage[..], "detector" | "descriptor" | "matcher" | "locator");
    trial.header.components.iter().filter(move |component| trial.images || !sees(component))
}
