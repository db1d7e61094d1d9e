//! KITTI's `calib.txt` (P0 to P3 of rectified images) and `calib_cam_to_cam.txt` (with sizes).

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;

use super::{
    found::{Found, Given},
    text::{Source, rows, size},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    let line = |line: &str| {
        let (key, rest) = line.split_once(':')?;
        let numbers: Option<Vec<f64>> =
            rest.split_whitespace().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        Some((key.trim().to_owned(), numbers?))
    };
    let lines: BTreeMap<String, Vec<f64>> = source.text.lines().filter_map(line).collect();
    let name =
        |camera: &str| if lines.contains_key("P_rect_00") { format!("P_rect_0{camera}") } else { format!("P{camera}") };
    if !lines.contains_key(&name("0")) {
        return Ok(None);
    }
    let projection = |camera: &str| -> Result<[f64; 12], Fault> {
        let key = name(camera);
        let numbers = lines.get(&key).cloned().unwrap_or_default();
        let p: [f64; 12] = numbers
            .try_into()
            .map_err(|_| source.fault(&key, format!("`{key}` without 12 numbers")).remedy("give P = K [I | t]"))?;
        let [_, skew, _, _, zero, _, _, _, a, b, c, _] = p;
        if [skew, zero, a, b] != [0.0; 4] || c != 1.0 {
            return Err(source
                .fault(&key, format!("`{key}` is not of the form K [I | t]"))
                .remedy("give rectified cameras"));
        }
        Ok(p)
    };
    let (p, q) = (projection("0")?, projection("1")?);
    let stated = lines.get("S_rect_00").and_then(|numbers| numbers.as_slice().try_into().ok());
    let size = size(source, stated, given)?;
    let camera = |[fx, _, cx, _, _, fy, cy, ..]: [f64; 12]| CameraNumbers {
        size,
        fx,
        fy,
        cx,
        cy,
        model: Model::Pinhole,
        distortion: Vec::new(),
        port: None,
    };
    let shift = |p: &[f64; 12]| Vector3::new((p[3] - p[2] * p[11]) / p[0], (p[7] - p[6] * p[11]) / p[5], p[11]);
    let numbers = RigNumbers {
        right_from_left: rows(&Matrix3::identity(), &((shift(&q) - shift(&p)) * given.unit)),
        rectified: true,
        left: camera(p),
        right: camera(q),
    };
    let mut found = Found::new("KITTI calibration", numbers);
    found.notes.push("it is of the rectified grey cameras 0 and 1".to_owned());
    Ok(Some(found))
}
