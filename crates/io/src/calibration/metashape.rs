//! Metashape's cameras (`Export Cameras`, xml) of a multi-camera system: a sensor, and one with `master_id` that has its
//! place in the first.
//!
//! x' = x·ρ + P1 (r² + 2x²) + 2 P2 x y, y' = y·ρ + P2 (r² + 2y²) + 2 P1 x y, u = w/2 + cx + f x' + B1 x' + B2 y', with the
//! corner of the first pixel at (0, 0).

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;
use seafix_component::Fault;

use super::{
    found::{Found, Given},
    opencv_xml::{document, numbers},
    text::{Source, rotation, rows},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    if !(source.text.contains("<calibration")
        && source.text.contains('<')
        && source.file.extension().is_some_and(|end| end == "xml"))
    {
        return Ok(None);
    }
    let document = document(source)?;
    let sensors: Vec<Node<'_, '_>> = document.descendants().filter(|node| node.has_tag_name("sensor")).collect();
    let slave = sensors.iter().find(|node| node.has_attribute("master_id"));
    let Some(slave) = slave else {
        let fault = source.fault("<calibration", "no second sensor with a place in the first");
        return Err(
            fault.remedy("export the cameras of a multi-camera system, with `master_id`, `rotation` and `location`")
        );
    };
    let master = sensors.iter().find(|node| node.attribute("id") == slave.attribute("master_id"));
    let master =
        master.ok_or_else(|| source.fault("master_id", "no sensor of this id").remedy("export all sensors"))?;
    let child = |name: &str| {
        let node = slave.children().find(|child| child.has_tag_name(name));
        node.and_then(numbers).ok_or_else(|| {
            source.fault("master_id", format!("no `{name}` of the second sensor")).remedy("export the adjusted system")
        })
    };
    let (turn, place) = (child("rotation")?, child("location")?);
    if turn.len() != 9 || place.len() != 3 {
        return Err(source
            .fault("<rotation", "`rotation` or `location` of another length")
            .remedy("give 9 and 3 numbers"));
    }
    // The sensor's place in the master: master_from_slave.
    let turn = rotation(source, "<rotation", &Matrix3::from_row_slice(&turn))?.transpose();
    let step = -(turn * Vector3::from_column_slice(&place)) * given.unit;
    let numbers = RigNumbers {
        right_from_left: rows(&turn, &step),
        rectified: false,
        left: camera(source, master)?,
        right: camera(source, slave)?,
    };
    Ok(Some(Found::new("Metashape cameras", numbers)))
}

fn camera(source: &Source, sensor: &Node<'_, '_>) -> Result<CameraNumbers, Fault> {
    let mut found = sensor.children().filter(|child| child.has_tag_name("calibration"));
    let adjusted = found.clone().find(|child| child.attribute("class") == Some("adjusted"));
    let Some(calibration) = adjusted.or_else(|| found.next_back()) else {
        return Err(source.fault("<sensor", "a sensor without a calibration").remedy("adjust the cameras first"));
    };
    let kind = calibration.attribute("type").or_else(|| {
        calibration.children().find(|child| child.has_tag_name("projection")).and_then(|child| child.text())
    });
    let equidistant = match kind.unwrap_or("frame").trim() {
        "frame" => false,
        "equidistant_fisheye" | "fisheye" => true,
        other => {
            return Err(source
                .fault(other, "an unsupported projection")
                .value(other)
                .remedy("give frame or equidistant fisheye"));
        }
    };
    let value = |name: &str| {
        let node = calibration.children().find(|child| child.has_tag_name(name));
        node.and_then(numbers).and_then(|numbers| numbers.first().copied()).unwrap_or(0.0)
    };
    let resolution = calibration.children().find(|child| child.has_tag_name("resolution"));
    let side = |name: &str| resolution.and_then(|node| node.attribute(name)?.parse().ok()).unwrap_or(value(name));
    let (width, height, f) = (side("width"), side("height"), value("f"));
    let [b1, b2, k4] = ["b1", "b2", "k4"].map(value);
    if b2 != 0.0 || !equidistant && k4 != 0.0 {
        let fault = source
            .fault("<b2", "an affine skew b2 or a fourth radial coefficient k4")
            .value(format!("b2 = {b2}, k4 = {k4}"));
        return Err(fault.remedy("optimize the cameras without b2 and k4"));
    }
    let [k1, k2, k3, p1, p2] = ["k1", "k2", "k3", "p1", "p2"].map(value);
    if equidistant && [p1, p2] != [0.0; 2] {
        return Err(source
            .fault("<p1", "tangential distortion of a fisheye lens")
            .remedy("optimize the cameras without p1 and p2"));
    }
    let (model, distortion) = match equidistant {
        true => (Model::Equidistant, vec![k1, k2, k3, k4]),
        // Metashape's P1 is OpenCV's p2.
        false => (Model::Pinhole, vec![k1, k2, p2, p1, k3]),
    };
    let size = [width as u32, height as u32];
    let [cx, cy] = [0.5 * width + value("cx") - 0.5, 0.5 * height + value("cy") - 0.5];
    Ok(CameraNumbers { size, fx: f + b1, fy: f, cx, cy, model, distortion, port: None })
}
