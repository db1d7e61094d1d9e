//! What was compared: the algorithm, its formulas and frames, the pipeline stage by stage.

use seafix_log::Component;

use super::distinct;
use crate::{
    document::{Block, Cell, Head, Section, Span, Table, code, italic, sub, sup, text},
    run::{Run, Trial},
};

pub(super) fn section(run: &Run) -> Section {
    let images = run.trials.iter().any(|trial| trial.images);
    let points = run.trials.iter().any(|trial| !trial.images);
    let begin = match (images, points) {
        (true, false) => "Corners of both images are described, matched and triangulated into a cloud",
        (true, true) => {
            "Corners of both images are described, matched and triangulated into a cloud; where the source gives no images, the cloud comes from it as it is"
        }
        _ => {
            "The source gives no images, so nothing is detected, described or matched: the cloud comes from it as it is"
        }
    };
    let named = run.trials.iter().all(|trial| trial.method()[0] == "labelled");
    let middle = match named {
        true => {
            "; every point says which one it is, so that nothing is searched, and for each target the solver computes the pose "
        }
        false => {
            "; for each target, the prior selects candidates, the search finds a structurally coherent set among them, and the solver computes the pose "
        }
    };
    let [h, c, p, e] = ["H", "C", "P", "p"].map(italic);
    let algorithm = text![
        begin,
        middle,
        h.clone(),
        " that carries its points ",
        c.clone(),
        " onto the model’s points ",
        p.clone(),
        ". An attempt that fails a test is refused with its reason."
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
        "Frames: the camera’s is the left camera’s, x to the right, y downwards, z forward; the object’s has its origin in the first base point P1, x from P1 to P3, z along (P2 − P1) × (P3 − P1), right-handed. ",
        "Points are columns, ",
        e.clone(),
        sub("a"),
        " = ",
        italic("T"),
        sub("ab"),
        " ",
        e,
        sub("b"),
        "; a covariance belongs to ξ = (φ, ρ), the rotation first, in ",
        italic("T"),
        " Exp(ξ), in the camera’s frame. Lengths are metres, angles degrees, the centre of the first pixel is (0, 0).",
    ];
    Section::new("Method").with([
        Block::Paragraph(algorithm),
        Block::Formula(coherence),
        Block::Paragraph(frames),
        Block::Table(pipeline(run)),
        Block::Paragraph(text![
            "Where ρ is the solver’s measure: the squared distance, its square by the covariance, or the distances in the pixels of both images (", sup(""), "Table 1 says which)."
        ].into_iter().filter(|span| !span.plain().is_empty()).collect()),
    ])
}

fn pipeline(run: &Run) -> Table {
    let components: Vec<&Component> = run.trials.iter().flat_map(components).collect();
    let stages = distinct(components.iter().map(|component| component.stage.clone()));
    let heads = ["Stage", "Component", "What it does, and its settings"].map(Head::words).to_vec();
    let caption = text!["The pipeline and its parameters. Several lines of one stage are the alternatives compared."];
    let mut table = Table::new("pipeline", caption, heads);
    for stage in &stages {
        let mut known: Vec<&Component> = Vec::new();
        for component in components.iter().filter(|component| component.stage == *stage) {
            if known.contains(component) {
                continue;
            }
            let mut said = text![component.summary.clone()];
            if !component.source.is_empty() {
                said.push(format!(" ({})", component.source).into());
            }
            if !component.settings.is_empty() {
                said.push(". ".into());
            }
            for (index, (key, value)) in component.settings.iter().enumerate() {
                said.extend((index > 0).then(|| Span::from(", ")));
                said.push(code(format!("{key} = {value}")));
            }
            let first = known.is_empty();
            let stage = if first { component.stage.clone() } else { String::new() };
            table.line(first, vec![stage.into(), component.name.clone().into(), Cell::prose(said)]);
            known.push(component);
        }
    }
    table
}

/// The components that did some work in `trial`: those that see images only where there were images.
fn components(trial: &Trial) -> impl Iterator<Item = &Component> {
    let sees =
        |component: &Component| matches!(&component.stage[..], "detector" | "descriptor" | "matcher" | "locator");
    trial.header.components.iter().filter(move |component| trial.images || !sees(component))
}
