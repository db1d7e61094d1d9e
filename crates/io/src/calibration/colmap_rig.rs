//! COLMAP's `rig_config.json`: the cameras of a rig by the prefixes of their images, with cam_from_rig and, where stated,
//! their intrinsics. Other intrinsics stand in `cameras.txt` beside it, and `images.txt` states whose they are.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Fault, read_text};
use serde_json::Value;

use super::{
    colmap::{self, SUPPORTED, unsupported},
    found::{Found, Given},
    text::{Source, rows, size, turn},
};
use crate::dataset::{CameraNumbers, RigNumbers};

/// Whether a text is that of a rig configuration.
pub(super) fn is_one(text: &str) -> bool {
    text.contains("\"cameras\"") && text.contains("\"image_prefix\"")
}

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let Some(source) = sources.iter().find(|source| is_one(&source.text)) else { return Ok(None) };
    let rigs: Vec<Value> = serde_json::from_str(&source.text).map_err(|error| {
        let fault = Fault::new("invalid JSON", &source.file).on_line(error.line()).value(&error);
        fault.remedy("give a list of rigs, as `colmap rig_configurator` takes it")
    })?;
    let cameras: Vec<&Value> = rigs.iter().flat_map(|rig| rig["cameras"].as_array().into_iter().flatten()).collect();
    let &[first, second] = cameras.as_slice() else {
        let fault = source.fault("cameras", "not a rig of two cameras").value(format!("{} cameras", cameras.len()));
        return Err(fault.remedy("remove the rigs and cameras that are not the stereo pair"));
    };
    let is_reference = |camera: &Value| camera["ref_sensor"] == true;
    let (left, right) = match (is_reference(first), is_reference(second)) {
        (true, false) => (first, second),
        (false, true) => (second, first),
        _ => {
            let fault = source.fault("ref_sensor", "a rig without one reference camera");
            return Err(fault.remedy("set `\"ref_sensor\": true` for one camera, the left one"));
        }
    };
    let (turn, step) = pose(source, right)?;
    let prefix = |camera: &Value| camera["image_prefix"].as_str().unwrap_or_default().to_owned();
    let prefixes = [prefix(left), prefix(right)];
    let numbers = RigNumbers {
        right_from_left: rows(&turn, &(step * given.unit)),
        rectified: false,
        left: camera(source, sources, left, given, &prefixes[0])?,
        right: camera(source, sources, right, given, &prefixes[1])?,
    };
    let mut found = Found::new("COLMAP rig_config.json", numbers);
    found.notes.push(format!("`{}` is the left camera; lengths are in the unit of the file", prefixes[0]));
    Ok(Some(found))
}

/// The pose of the other camera in the rig, whose frame is that of the reference camera.
fn pose(source: &Source, camera: &Value) -> Result<(Matrix3<f64>, Vector3<f64>), Fault> {
    let numbers =
        |key: &str| camera[key].as_array().map(|all| all.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
    let (rotation, step) = (numbers("cam_from_rig_rotation"), numbers("cam_from_rig_translation"));
    match (rotation.as_deref(), step.as_deref()) {
        (Some(&[w, x, y, z]), Some(&[tx, ty, tz])) if w * w + x * x + y * y + z * z > 0.0 => {
            Ok((turn([w, x, y, z]), Vector3::new(tx, ty, tz)))
        }
        _ => {
            let fault = source.fault("image_prefix", "no pose of the second camera");
            Err(fault.remedy(
                "give `cam_from_rig_rotation` (w x y z) and `cam_from_rig_translation`, or the rigs.txt that \
                 `colmap model_converter --output_type TXT` writes",
            ))
        }
    }
}

/// The intrinsics of a camera: those of the file, else those of the camera of its images.
fn camera(
    source: &Source,
    sources: &[Source],
    camera: &Value,
    given: Given,
    prefix: &str,
) -> Result<CameraNumbers, Fault> {
    let beside = |name: &str| match sources.iter().find(|source| source.file.ends_with(name)) {
        Some(source) => Some(source.text.clone()),
        None => read_text(&source.file.with_file_name(name)).ok(),
    };
    let file = source.file.with_file_name("cameras.txt");
    let known = match beside("cameras.txt") {
        Some(text) => colmap::read_cameras(&Source { file: file.clone(), text })?,
        None => std::collections::BTreeMap::new(),
    };
    let of_images = beside("images.txt").and_then(|text| camera_of(&text, prefix));
    let id = of_images.or_else(|| (known.len() == 1).then(|| known.keys().next().cloned()).flatten());
    let own = id.and_then(|id| known.get(&id));
    let Some(name) = camera["camera_model_name"].as_str() else {
        return own.cloned().ok_or_else(|| {
            let fault = Fault::new("no intrinsics of a camera", &source.file).value(format!("`{prefix}`"));
            fault.remedy(
                "give `camera_model_name` and `camera_params`, or cameras.txt and images.txt beside it, as `colmap \
                 model_converter --output_type TXT` writes them",
            )
        });
    };
    let parameters: Option<Vec<f64>> =
        camera["camera_params"].as_array().map(|all| all.iter().filter_map(Value::as_f64).collect());
    // The file states no sizes; cameras of one reconstruction that agree on theirs do.
    let mut sizes: Vec<[u32; 2]> = own.map(|camera| camera.size).into_iter().collect();
    if sizes.is_empty() {
        sizes = known.values().map(|camera| camera.size).collect();
        sizes.dedup();
    }
    let stated = (sizes.len() == 1).then(|| sizes[0].map(f64::from));
    let size = size(source, stated, given)?;
    parameters
        .and_then(|parameters| colmap::camera(name, size, &parameters))
        .ok_or_else(|| source.fault("camera_model_name", unsupported(name)).remedy(SUPPORTED))
}

/// The camera of the first image of `images.txt` whose name begins with `prefix`: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID
/// NAME`. The lines between are those of points.
fn camera_of(text: &str, prefix: &str) -> Option<String> {
    text.lines().filter(|line| !line.starts_with('#')).find_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let name = words.get(9)?;
        let is_image = words.len() == 10 && words[9].parse::<f64>().is_err() && Path::new(name).extension().is_some();
        (is_image && name.starts_with(prefix)).then(|| words[8].to_owned())
    })
}
