//! A model from the marks in the pairs of a dive.

use std::path::Path;

use seafix_component::{Fault, read_text};
use seafix_data::{CalibrationSigma, DiveModel, DivePoint, ModelByHand, ModelFromDive, StereoPairs};
use seafix_vision::LineFrontEnd;
use serde_json::{Value, json};

use super::{
    super::pair_source::turned,
    arguments::{Model, Printed},
    page, pair,
};
use crate::{
    atomic_file::AtomicFile,
    exit::{Ended, Failure, INPUT, OUTPUT},
    terminal::{Progress, notify},
};

/// The pairs of a dive, with their rig as the images show it; warnings are printed.
pub(super) fn opened(model: &Model) -> Result<StereoPairs, Failure> {
    let mut pairs = model.pair_source.open(&model.left, false, model.limits.of_images())?;
    pairs.warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
    if let Some(fault) = pairs.swapped() {
        return Err(Failure::new(INPUT, fault));
    }
    let rotation = if model.dive.keep_rig { None } else { pairs.right_camera_rotation() };
    if let Some(found) = rotation {
        notify(&format!("warning: {}", turned(&found)));
        pairs.rig = found.rig;
    }
    Ok(pairs)
}

/// Builds the model of a dive and writes it.
pub(super) fn execute(
    model: &Model,
    marks: &Path,
    by_hand: ModelByHand<'_>,
    calibration: CalibrationSigma,
    edges: Option<&LineFrontEnd>,
) -> Ended {
    let faults = |faults: Vec<Fault>| Failure::faults(INPUT, &faults);
    let arguments = &model.dive;
    let dive = opened(model)?;
    let odometry = arguments.odometry(&dive)?;
    let content = read_text(marks).map_err(|fault| Failure::new(INPUT, fault))?;
    let inputs = [&*model.left, marks];
    let (halves, pictures) = (arguments.half, arguments.page.is_some());
    let corner_sigma = arguments.corner_sigma;
    let from_dive =
        ModelFromDive { by_hand, calibration, corner_sigma, edges, odometry: odometry.as_deref(), halves, pictures };
    if dive.stamps().len() == 1 {
        let built = from_dive.of_only_pair(&dive, &content, marks).map_err(faults)?;
        return model.finish(&pair::printed(&built), &inputs);
    }
    // An output that cannot be written is reported before the work.
    let page = arguments.page.as_deref().map(|path| AtomicFile::begin(path, model.replacing, &inputs)).transpose()?;
    let progress = Progress::new();
    progress.expect(dive.stamps().len());
    let built = arguments.pool()?.install(|| from_dive.model(&dive, &content, marks, &mut || progress.step("")));
    progress.end();
    let built = built.map_err(faults)?;
    if let Some(page) = page {
        page.finish(views(&built).map_err(|message| Failure::new(OUTPUT, message))?)?;
    }
    let printed = Printed {
        site: built.site.to_toml(),
        text: text(&built),
        json: json(&built),
        warnings: built.warnings.iter().map(ToString::to_string).collect(),
    };
    model.finish(&printed, &inputs)
}

/// The page of the best views.
fn views(model: &DiveModel) -> Result<String, String> {
    fn entry(point: &DivePoint) -> page::Entry<'_> {
        let line = format!(
            "σ {:.2} mm, {} views, {:.0}° apart, {} rejected",
            point.sigma * 1e3,
            point.observations.len(),
            point.parallax.to_degrees(),
            point.rejected.len()
        );
        page::Entry { id: &point.id, lines: vec![line], pictures: point.pictures.iter().collect() }
    }
    let entries: Vec<page::Entry<'_>> = model.points.iter().map(entry).collect();
    let introduction = format!(
        "The best views of each point. The cross is the position that the model predicts; the green bars are three \
         standard deviations of it, {:.0} times enlarged.",
        page::BAR / 3.0
    );
    page::page(&model.site.name, &introduction, &entries)
}

/// The output as text: position, standard deviation and views of each point.
fn text(model: &DiveModel) -> String {
    let mut text = format!(
        "{:16} {:>9} {:>9} {:>9}  {:>7} {:>6} {:>9} {:>9}\n",
        "point", "x mm", "y mm", "z mm", "σ mm", "views", "parallax", "rejected"
    );
    for point in &model.points {
        let [x, y, z] = <[f64; 3]>::from(point.at.coords * 1e3);
        let (id, sigma, views) = (&point.id, point.sigma * 1e3, point.observations.len());
        let (parallax, rejected) = (point.parallax.to_degrees(), point.rejected.len());
        text += &format!("{id:16} {x:9.1} {y:9.1} {z:9.1}  {sigma:7.2} {views:6} {parallax:8.1}° {rejected:9}\n");
    }
    for edge in model.edges.iter().flatten() {
        let (views, in_view, sigma) = (edge.pairs.len(), edge.in_view, edge.sigma * 1e3);
        text += &format!("{}: {views} of {in_view} pairs show it, σ {sigma:.2} mm\n", edge.id);
    }
    let [common, difference] = model.excess;
    text += &format!(
        "{} points from {} of {} pairs, χ² {:.0} of {}; noise beyond that of the images: {common:.3} px, {difference:.3} \
         px in the disparity\n",
        model.points.len(),
        model.used.len(),
        model.pairs,
        model.chi2,
        model.dof
    );
    if let Some(halves) = &model.halves {
        let chi2 = halves.chi2.map_or_else(String::new, |chi2| format!(", χ² {chi2:.0} of {}", halves.dof));
        text += &format!("models of every second pair differ by {:.2} mm RMS a coordinate{chi2}\n", halves.rms * 1e3);
    }
    let unseen: Vec<&str> = model.sides.iter().filter(|(_, seen)| !seen).map(|(side, _)| *side).collect();
    if !unseen.is_empty() {
        text += &format!("no pair sees the object from {}\n", unseen.join(", "));
    }
    let object = &model.site.objects[0];
    let base = object.base.map(|index| object.points[index].id.clone());
    text + &format!("the object frame is that of {}\n", base.join(", "))
}

/// The output for programs: one JSON object.
fn json(model: &DiveModel) -> String {
    let point = |point: &DivePoint| -> Value {
        json!({
            "id": point.id,
            "at": <[f64; 3]>::from(point.at.coords),
            "covariance": <[[f64; 3]; 3]>::from(point.covariance),
            "sigma": point.sigma,
            "corner": point.corner,
            "lines": point.lines,
            "parallax_deg": point.parallax.to_degrees(),
            "observations": point.observations.iter().map(|(stamp_ns, at)| json!({
                "stamp_ns": stamp_ns,
                "pixels": [[at.left.u, at.left.v], [at.right.u, at.right.v]],
            })).collect::<Vec<_>>(),
            "rejected": point.rejected.iter().map(|(stamp_ns, why)| json!({ "stamp_ns": stamp_ns, "why": why }))
                .collect::<Vec<_>>(),
        })
    };
    let object = &model.site.objects[0];
    let sides = |seen: bool| model.sides.iter().filter(|side| side.1 == seen).map(|side| side.0).collect::<Vec<_>>();
    let value = json!({
        "object": object.id,
        "base": object.base.map(|index| &object.points[index].id),
        "points": model.points.iter().map(point).collect::<Vec<_>>(),
        "edges": model.edges.as_ref().map(|edges| edges.iter().map(|edge| json!({
            "id": edge.id,
            "pairs": edge.pairs,
            "in_view": edge.in_view,
            "sigma": edge.sigma,
            "scatter": edge.scatter,
        })).collect::<Vec<_>>()),
        "given_up": model.given_up.iter().map(|(id, why)| json!({ "id": id, "why": why })).collect::<Vec<_>>(),
        "pairs": model.pairs,
        "used": model.used,
        "motions": model.motions,
        "excess_px": { "common": model.excess[0], "disparity": model.excess[1] },
        "chi2": model.chi2,
        "dof": model.dof,
        "sides": { "seen": sides(true), "unseen": sides(false) },
        "halves": model.halves.as_ref().map(|halves| json!({
            "rms": halves.rms,
            "chi2": halves.chi2,
            "dof": halves.dof,
            "scale": halves.scale,
            "scale_sigma": halves.scale_sigma,
        })),
        "warnings": model.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    value.to_string() + "\n"
}
