//! `seafix model`.

use std::path::PathBuf;

use clap::Args;
use seafix::{Pipeline, Rig};
use seafix_component::Fault;
use seafix_component::read_text;
use seafix_data::{
    HandModel, HandPoint, ModelByHand,
    dataset::{are_identical, identical_images_fault},
};
use seafix_experiment::changed_pipeline;
use seafix_io::read_image;
use serde_json::{Value, json};

use super::limits::Limits;
use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Model {
    /// The left image.
    left: PathBuf,
    /// The right image.
    right: PathBuf,
    /// The stereo rig: a dataset.toml, of which only the rig and `bits` are read.
    #[arg(long, value_name = "DATASET.toml")]
    rig: PathBuf,
    /// The marks (px): lines id,left_u,left_v,right_u,right_v below that header; empty right coordinates are estimated.
    #[arg(long, value_name = "CLICKS.csv")]
    points: PathBuf,
    /// The id of the object.
    #[arg(long, default_value = "object")]
    id: String,
    /// P1, P2 and P3 of the object's frame: P1 is the origin, P3 lies on +x, P2 on the side of -y [default: the widest
    /// triangle].
    #[arg(long, value_name = "P1,P2,P3", value_delimiter = ',', num_args = 1)]
    base: Vec<String>,
    /// Maximum distance of a mark from its corner (px).
    #[arg(long, default_value_t = 4.0)]
    reach: f64,
    /// Standard deviation of a mark without a corner (px).
    #[arg(long, default_value_t = 1.0)]
    mark_sigma: f64,
    /// Change a setting of the pipeline: a dotted key and a TOML value, `locator.name="junction"`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    limits: Limits,
    /// Print one JSON object with every point and its covariance.
    #[arg(long)]
    json: bool,
    /// Write the site (seafix-site/1) to this file [default: standard output].
    #[arg(long, value_name = "SITE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
}

impl Model {
    pub(crate) fn execute(&self) -> Ended {
        let usage = |message: String| Failure::new(USAGE, message);
        let input = |fault: Fault| Failure::new(INPUT, fault);
        for (name, value, max) in [("reach", self.reach, 100.0), ("mark-sigma", self.mark_sigma, 100.0)] {
            if !(value > 0.0 && value <= max) {
                return Err(usage(format!(
                    "invalid --{name} {value}: outside of 0 to {max} px; give a positive number"
                )));
            }
        }
        let base = match &self.base[..] {
            [] => None,
            [p1, p2, p3] => Some([p1, p2, p3].map(String::clone)),
            other => {
                return Err(usage(format!(
                    "invalid --base {}: not three ids; separate three ids by commas",
                    other.join(",")
                )));
            }
        };
        let pipeline =
            changed_pipeline(&Pipeline::default(), &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let front_end = pipeline.front_end().map_err(|error| Failure::new(USAGE, error))?;
        let Rig { stereo: rig, bits, .. } = Rig::from_file(&self.rig).map_err(input)?;
        let limits = self.limits.of_images();
        let left = read_image(&self.left, rig.left().size(), bits, limits).map_err(input)?;
        let right = read_image(&self.right, rig.right().size(), bits, limits).map_err(input)?;
        if are_identical(&left, &right) {
            return Err(Failure::new(INPUT, identical_images_fault(&self.left, &self.right)));
        }
        let text = read_text(&self.points).map_err(input)?;
        let (reach, mark_sigma, object) = (self.reach, self.mark_sigma, self.id.clone());
        let by_hand = ModelByHand { front_end: &front_end, reach, mark_sigma, object, base };
        let model = by_hand.model([&left, &right], &rig, &text, &self.points).map_err(input)?;
        model.warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        let site = model.site.to_toml();
        if let Some(path) = &self.out {
            let inputs = [&*self.left, &*self.right, &*self.rig, &*self.points];
            AtomicFile::begin(path, self.replacing, &inputs)?.finish(&site)?;
        }
        match (self.json, &self.out) {
            (true, _) => print(&machines(&model))?,
            (false, Some(_)) => print(&people(&model))?,
            (false, None) => {
                people(&model).lines().for_each(notify);
                print(&site)?;
            }
        }
        Ok(DONE)
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

/// The output for people: position, standard deviation and method of each point.
fn people(model: &HandModel) -> String {
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
fn machines(model: &HandModel) -> String {
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
