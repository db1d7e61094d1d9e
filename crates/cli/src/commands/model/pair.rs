//! A model from the marks in one stereo pair.

use std::path::Path;

use seafix::Rig;
use seafix_component::{Fault, read_text};
use seafix_data::{
    HandModel, HandPoint, ModelByHand,
    dataset::{are_identical, identical_images_fault},
};
use seafix_io::read_image;
use serde_json::{Value, json};

use super::arguments::{Model, Printed};
use crate::exit::{Ended, Failure, INPUT};

/// The files of a pair: both images, the rig and the marks.
pub(super) struct PairFiles<'a> {
    pub(super) left: &'a Path,
    pub(super) right: &'a Path,
    pub(super) rig: &'a Path,
    pub(super) points: &'a Path,
}

/// Builds the model of a pair and writes it.
pub(super) fn execute(model: &Model, files: &PairFiles<'_>, by_hand: &ModelByHand<'_>) -> Ended {
    let input = |fault: Fault| Failure::new(INPUT, fault);
    let Rig { stereo: rig, bits, .. } = Rig::from_file(files.rig).map_err(input)?;
    let limits = model.limits.of_images();
    let left = read_image(files.left, rig.left().size(), bits, limits).map_err(input)?;
    let right = read_image(files.right, rig.right().size(), bits, limits).map_err(input)?;
    if are_identical(&left, &right) {
        return Err(Failure::new(INPUT, identical_images_fault(files.left, files.right)));
    }
    let text = read_text(files.points).map_err(input)?;
    let built = by_hand.model([&left, &right], &rig, &text, files.points).map_err(input)?;
    model.finish(&printed(&built), &[files.left, files.right, files.rig, files.points])
}

/// The outputs of a model from one pair.
pub(super) fn printed(model: &HandModel) -> Printed {
    Printed {
        site: model.site.to_toml(),
        text: text(model),
        json: json(model),
        warnings: model.warnings.iter().map(ToString::to_string).collect(),
    }
}

/// The methods that located a point in the left and right image.
fn found(point: &HandPoint) -> [&'static str; 2] {
    let left = if point.corner { "corner" } else { "as marked" };
    let right = match (point.aligned, point.mark.right.is_some()) {
        (true, true) => "aligned",
        (true, false) => "sought",
        (false, true) => "as marked",
        (false, false) => "sought, not aligned",
    };
    [left, right]
}

/// The output as text: position, standard deviation and method of each point.
fn text(model: &HandModel) -> String {
    let mut text = format!(
        "{:16} {:>9} {:>9} {:>9}  {:>7} {:>7}  {:9} right\n",
        "point", "x mm", "y mm", "z mm", "σ mm", "depth m", "left"
    );
    for point in &model.points {
        let [x, y, z] = <[f64; 3]>::from(point.at.coords * 1e3);
        let [left, right] = found(point);
        let (sigma, depth) = (point.sigma() * 1e3, point.measured.position.at.coords.z);
        let id = &point.mark.id;
        text += &format!("{id:16} {x:9.1} {y:9.1} {z:9.1}  {sigma:7.2} {depth:7.3}  {left:9} {right}\n");
    }
    let object = &model.site.objects[0];
    let base = object.base.map(|index| object.points[index].id.clone());
    text +=
        "No point has a normal, so each counts as visible from every side; add `normal` to the site where it is not.\n";
    text + &format!("{} points; the object frame is that of {}\n", model.points.len(), base.join(", "))
}

/// The output for programs: one JSON object.
fn json(model: &HandModel) -> String {
    let point = |point: &HandPoint| -> Value {
        let [left, right] = found(point);
        json!({
            "id": point.mark.id,
            "at": <[f64; 3]>::from(point.at.coords),
            "covariance": <[[f64; 3]; 3]>::from(point.covariance),
            "sigma": point.sigma(),
            "camera": <[f64; 3]>::from(point.measured.position.at.coords),
            "pixels": point.measured.pixels.map(|pixels| [
                [pixels.at.left.u, pixels.at.left.v],
                [pixels.at.right.u, pixels.at.right.v],
            ]),
            "left": left,
            "right": right,
        })
    };
    let object = &model.site.objects[0];
    let value = json!({
        "object": object.id,
        "base": object.base.map(|index| &object.points[index].id),
        "object_from_camera": model.object_from_camera.rows(),
        "points": model.points.iter().map(point).collect::<Vec<_>>(),
    });
    value.to_string() + "\n"
}
