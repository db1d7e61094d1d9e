//! COLMAP's `cameras.txt` and `rigs.txt`: `RIG_ID NUM_SENSORS REF_TYPE REF_ID SENSORS[] as TYPE ID HAS_POSE QW QX QY QZ TX TY
//! TZ` with sensor_from_rig. The centre of COLMAP's first pixel is (0.5, 0.5).

use std::collections::BTreeMap;

use nalgebra::Vector3;
use seafix_component::Fault;

use super::{
    found::{Found, Given},
    text::{Source, rows, turn},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let Some(cameras) = sources.iter().find(|source| is_cameras(&source.text)) else { return Ok(None) };
    let Some(rigs) = sources.iter().find(|source| source.text.contains("RIG_ID") || source.file.ends_with("rigs.txt"))
    else {
        let fault = cameras.fault("CAMERA_ID", "cameras without their rig");
        return Err(fault
            .remedy("give rigs.txt too: `colmap rig_configurator`, then `colmap model_converter --output_type TXT`"));
    };
    let all = read_cameras(cameras)?;
    let line = rigs.text.lines().enumerate().find(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let Some((index, line)) = line else { return Err(rigs.fault("", "no rig").remedy("give a rig of two cameras")) };
    let words: Vec<&str> = line.split_whitespace().collect();
    let bad = || {
        let fault = Fault::new("not a rig of two cameras", &rigs.file).on_line(index + 1).value(line);
        fault.remedy("a line is `RIG_ID 2 CAMERA ID CAMERA ID 1 QW QX QY QZ TX TY TZ`")
    };
    let [_, "2", "CAMERA", reference, "CAMERA", other, "1", pose @ ..] = words.as_slice() else { return Err(bad()) };
    let pose: Vec<f64> = pose.iter().filter_map(|word| word.parse().ok()).collect();
    let &[w, x, y, z, tx, ty, tz] = pose.as_slice() else { return Err(bad()) };
    let camera = |id: &str| {
        all.get(id).cloned().ok_or_else(|| {
            cameras.fault("", format!("no camera {id}, which the rig names")).remedy("give the cameras.txt of the rig")
        })
    };
    let numbers = RigNumbers {
        right_from_left: rows(&turn([w, x, y, z]), &(Vector3::new(tx, ty, tz) * given.unit)),
        rectified: false,
        left: camera(reference)?,
        right: camera(other)?,
    };
    let mut found = Found::new("COLMAP cameras and rigs", numbers);
    found.notes.push(format!("camera {reference} is the left one; lengths are in the unit of the reconstruction"));
    Ok(Some(found))
}

/// Whether a text is that of COLMAP's cameras, with or without the comment that heads it.
pub(super) fn is_cameras(text: &str) -> bool {
    const MODELS: [&str; 9] = [
        "SIMPLE_PINHOLE",
        "PINHOLE",
        "SIMPLE_RADIAL",
        "RADIAL",
        "OPENCV",
        "FULL_OPENCV",
        "OPENCV_FISHEYE",
        "SIMPLE_RADIAL_FISHEYE",
        "RADIAL_FISHEYE",
    ];
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#'));
    let is_model = first.and_then(|line| line.split_whitespace().nth(1)).is_some_and(|word| MODELS.contains(&word));
    is_model || text.contains("CAMERA_ID") && text.contains("MODEL")
}

pub(super) fn read_cameras(source: &Source) -> Result<BTreeMap<String, CameraNumbers>, Fault> {
    let mut all = BTreeMap::new();
    for (index, line) in
        source.text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
    {
        let fault = |what: String| Fault::new(what, &source.file).on_line(index + 1).value(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        let [id, name, width, height, parameters @ ..] = words.as_slice() else {
            return Err(fault("not a camera".to_owned()).remedy("a line is `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`"));
        };
        let size = [width, height].map(|word| word.parse::<u32>().unwrap_or(0));
        let p: Option<Vec<f64>> = parameters.iter().map(|word| word.parse().ok()).collect();
        let camera = p.and_then(|p| camera(name, size, &p));
        let camera = camera.ok_or_else(|| fault(unsupported(name)).remedy(SUPPORTED))?;
        all.insert((*id).to_owned(), camera);
    }
    Ok(all)
}

/// The remedy for a camera that is not read.
pub(super) const SUPPORTED: &str = "give PINHOLE, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE or their simple forms";

/// What a camera is that is not read.
pub(super) fn unsupported(name: &str) -> String {
    format!("an unsupported camera model {name}, or a wrong number of parameters")
}

/// The camera of a model's name and parameters; `None` for another model or number of parameters.
pub(super) fn camera(name: &str, size: [u32; 2], parameters: &[f64]) -> Option<CameraNumbers> {
    let (focal, principal, model, distortion) = match (name, parameters) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f], [cx, cy], Model::Pinhole, vec![]),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], Model::Pinhole, vec![]),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f], [cx, cy], Model::Pinhole, vec![k, 0.0, 0.0, 0.0]),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], Model::Pinhole, vec![k1, k2, 0.0, 0.0]),
        ("OPENCV", &[fx, fy, cx, cy, ref rest @ ..]) if rest.len() == 4 => {
            ([fx, fy], [cx, cy], Model::Pinhole, rest.to_vec())
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, ref rest @ ..]) if rest.len() == 8 => {
            ([fx, fy], [cx, cy], Model::Pinhole, rest.to_vec())
        }
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, ref rest @ ..]) if rest.len() == 4 => {
            ([fx, fy], [cx, cy], Model::Equidistant, rest.to_vec())
        }
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f], [cx, cy], Model::Equidistant, vec![k, 0.0, 0.0, 0.0]),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], Model::Equidistant, vec![k1, k2, 0.0, 0.0]),
        _ => return None,
    };
    // COLMAP's first pixel has its centre at (0.5, 0.5).
    let [cx, cy] = principal.map(|c| c - 0.5);
    Some(CameraNumbers { size, fx: focal[0], fy: focal[1], cx, cy, model, distortion, port: None })
}
