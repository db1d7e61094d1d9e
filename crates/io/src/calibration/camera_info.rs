//! ROS's `left.yaml` and `right.yaml` (camera_calibration_parsers, CameraInfo): K, D, R and P of each camera.

use nalgebra::Vector3;
use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    text::{Source, camera, matrix, rotation, rows, size},
};
use crate::{
    dataset::{CameraNumbers, Model, RigNumbers},
    yaml,
};

/// The greatest skew of a rectified camera, as a part of its focal length: the rounding of six digits.
const SKEW: f64 = 1e-6;

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let Some(content) = sources[0].yaml() else { return Ok(None) };
    let content = content?;
    if projection(&content).is_badvalue() || width(&content).is_badvalue() {
        return Ok(None);
    }
    let [left, right] = sources else {
        let fault = sources[0].fault("projection_matrix", "the calibration of one camera");
        return Err(fault.remedy("give both, left.yaml and right.yaml"));
    };
    let other = right.yaml().ok_or_else(|| right.fault("", "not a calibration of ROS").remedy("give right.yaml"))??;
    let p = [(left, &content), (right, &other)]
        .map(|(source, content)| source.numbers::<12>("projection_matrix", projection(content)));
    let [p, q] = [p[0].clone()?, p[1].clone()?];
    for (source, p) in [(left, &p), (right, &q)] {
        if p[0] != 0.0 && ![p[1], p[4], p[8], p[9]].iter().all(|part| part.abs() <= SKEW * p[0].abs()) {
            let fault = source.fault("projection_matrix", "P is not of the form K [I | t]").value(format!("{p:?}"));
            return Err(fault.remedy(
                "give the files of a stereo calibration: P of rectified cameras has neither skew nor rotation",
            ));
        }
    }
    // Before the baseline, which an uncalibrated camera lacks too.
    let cameras = [raw(left, &content, given)?, raw(right, &other, given)?];
    // P = K [I | t]: the left camera's centre in the rectified right view.
    let shift = |p: &[f64; 12]| Vector3::new((p[3] - p[2] * p[11]) / p[0], (p[7] - p[6] * p[11]) / p[5], p[11]);
    let between = (shift(&q) - shift(&p)) * given.unit;
    if !(between.norm() > 0.0) {
        let fault = right.fault("projection_matrix", "no baseline in P");
        return Err(
            fault.remedy("give the files of a stereo calibration, where P[3] of the right camera is −fx·baseline")
        );
    }
    let turn = |source: &Source, content: &Yaml| {
        let r = if content["r"].is_badvalue() { &content["rectification_matrix"] } else { &content["r"] };
        let r = source.numbers::<9>("rectification_matrix", r)?;
        rotation(source, "rectification_matrix", &matrix(&r))
    };
    let (l, r) = (turn(left, &content)?, turn(right, &other)?);
    let numbers = RigNumbers {
        right_from_left: rows(&(r.transpose() * l), &(r.transpose() * between)),
        rectified: false,
        left: cameras[0].clone(),
        right: cameras[1].clone(),
    };
    let mut found = Found::new("ROS camera calibration", numbers);
    found.notes.push("it is of raw images; for rectified ones take P of both files".to_owned());
    Ok(Some(found))
}

fn projection(content: &Yaml) -> &Yaml {
    if content["p"].is_badvalue() { &content["projection_matrix"] } else { &content["p"] }
}

fn width(content: &Yaml) -> &Yaml {
    if content["width"].is_badvalue() { &content["image_width"] } else { &content["width"] }
}

fn raw(source: &Source, content: &Yaml, given: Given) -> Result<CameraNumbers, Fault> {
    let either =
        |a: &'static str, b: &'static str| if content[a].is_badvalue() { (b, &content[b]) } else { (a, &content[a]) };
    let (height, _) = (either("height", "image_height").1, ());
    let stated = yaml::number(width(content)).zip(yaml::number(height)).map(|(width, height)| [width, height]);
    let (key, k) = either("k", "camera_matrix");
    let (name, d) = either("d", "distortion_coefficients");
    let coefficients = source.list(name, d)?;
    let model = match content["distortion_model"].as_str().unwrap_or("plumb_bob") {
        "plumb_bob" | "rational_polynomial" => Model::Pinhole,
        "equidistant" | "fisheye" => Model::Equidistant,
        // Drivers of images without distortion state `none` or nothing, with zeros or without numbers.
        "none" | "None" | "" if coefficients.iter().all(|k| *k == 0.0) => Model::Pinhole,
        nothing @ ("none" | "None" | "") => {
            let fault =
                source.fault("distortion_model", "coefficients of no distortion model").value(format!("`{nothing}`"));
            return Err(fault.remedy("state plumb_bob, rational_polynomial or equidistant, or give no coefficients"));
        }
        other => {
            let fault = source.fault("distortion_model", "an unsupported distortion model").value(other);
            return Err(fault.remedy("give plumb_bob, rational_polynomial or equidistant"));
        }
    };
    camera(source, size(source, stated, given)?, &source.numbers(key, k)?, model, coefficients)
}
