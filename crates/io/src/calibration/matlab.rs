//! Exports of MATLAB: Bouguet's `Calib_Results_stereo.m`, and `stereoParameters` as JSON (`jsonencode(toStruct(…))`).
//!
//! Bouguet counts pixels from zero, the Computer Vision Toolbox from one. Both state lengths in millimetres by default.

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;
use serde_json::Value;

use super::{
    found::{Found, Given},
    text::{Source, matrix, rodrigues, rotation, rows, size},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    match source.file.extension().and_then(|end| end.to_str()) {
        Some("m") if source.text.contains("fc_left") => bouguet(source, given).map(Some),
        Some("json") if source.text.contains("CameraParameters1") => toolbox(source, given).map(Some),
        _ => Ok(None),
    }
}

fn bouguet(source: &Source, given: Given) -> Result<Found, Fault> {
    let all = |name: &str| {
        let line = source.text.lines().find_map(|line| line.trim().strip_prefix(name)?.trim_start().strip_prefix('='));
        let inner = line.map(|line| line.trim().trim_start_matches('[').split(']').next().unwrap_or_default());
        let words =
            inner.into_iter().flat_map(|inner| inner.split([';', ' ', ',', '\t'])).filter(|word| !word.is_empty());
        words.map(|word| word.trim().parse::<f64>().ok()).collect::<Option<Vec<f64>>>().unwrap_or_default()
    };
    let numbers = |name: &str, count: usize| {
        let numbers = all(name);
        if numbers.len() == count {
            Ok(numbers)
        } else {
            Err(source
                .fault(name, format!("`{name}` has {} numbers", numbers.len()))
                .remedy(format!("give {count} in one line")))
        }
    };
    let stated = all("nx").first().copied().zip(all("ny").first().copied()).map(|(width, height)| [width, height]);
    let camera = |side: &str| -> Result<CameraNumbers, Fault> {
        let (f, c) = (numbers(&format!("fc_{side}"), 2)?, numbers(&format!("cc_{side}"), 2)?);
        let skew = all(&format!("alpha_c_{side}")).first().copied().unwrap_or(0.0);
        if skew != 0.0 {
            return Err(source
                .fault("alpha_c", "a camera with skew")
                .value(skew)
                .remedy("calibrate with est_alpha = 0"));
        }
        let distortion = numbers(&format!("kc_{side}"), 5)?;
        Ok(CameraNumbers {
            size: size(source, stated, given)?,
            fx: f[0],
            fy: f[1],
            cx: c[0],
            cy: c[1],
            model: Model::Pinhole,
            distortion,
            port: None,
        })
    };
    let (om, t) = (numbers("om", 3)?, numbers("T", 3)?);
    let step = Vector3::from_column_slice(&t) * unit(&t, given);
    let numbers = RigNumbers {
        right_from_left: rows(&rodrigues([om[0], om[1], om[2]]), &step),
        rectified: false,
        left: camera("left")?,
        right: camera("right")?,
    };
    let mut found = Found::new("MATLAB Calib_Results_stereo.m", numbers);
    found.notes.extend(unit_note(&t, given));
    Ok(found)
}

/// The unit of lengths (m): millimetres are the default of both toolboxes, where the baseline can be nothing else.
fn unit(t: &[f64], given: Given) -> f64 {
    if given.unit == 1.0 && norm(t) > 10.0 { 1e-3 } else { given.unit }
}

fn norm(t: &[f64]) -> f64 {
    t.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn unit_note(t: &[f64], given: Given) -> Option<String> {
    (unit(t, given) != given.unit)
        .then(|| format!("lengths are taken as millimetres, MATLAB's unit: baseline {:.4} m", norm(t) * 1e-3))
}

fn toolbox(source: &Source, given: Given) -> Result<Found, Fault> {
    let content: Value = serde_json::from_str(&source.text).map_err(|error| {
        Fault::new("invalid JSON", &source.file)
            .on_line(error.line())
            .value(error)
            .remedy("give jsonencode(toStruct(stereoParams))")
    })?;
    let list = |value: &Value| -> Vec<f64> { flat(value) };
    let pose = &content["PoseCamera2"];
    // Older versions multiply rows from the left: their rotation is transposed.
    let (turn, t) = match pose.is_null() {
        true => (list(&content["RotationOfCamera2"]), list(&content["TranslationOfCamera2"])),
        false => (list(&pose["R"]), list(&pose["Translation"])),
    };
    let bad =
        |key: &str| source.fault(key, format!("no valid `{key}`")).remedy("give jsonencode(toStruct(stereoParams))");
    let turn: [f64; 9] = turn.try_into().map_err(|_| bad("RotationOfCamera2"))?;
    if t.len() != 3 {
        return Err(bad("TranslationOfCamera2"));
    }
    let turn = if pose.is_null() { matrix(&turn).transpose() } else { matrix(&turn) };
    let camera = |name: &str| -> Result<CameraNumbers, Fault> {
        let c = &content[name];
        let old = list(&c["IntrinsicMatrix"]);
        let k: [f64; 9] =
            if old.is_empty() { list(&c["K"]) } else { old }.try_into().map_err(|_| bad("IntrinsicMatrix"))?;
        let k: Matrix3<f64> = if c["IntrinsicMatrix"].is_null() { matrix(&k) } else { matrix(&k).transpose() };
        let (radial, tangential) = (list(&c["RadialDistortion"]), list(&c["TangentialDistortion"]));
        let (&[p1, p2], [k1, k2, rest @ ..]) = (tangential.as_slice(), radial.as_slice()) else {
            return Err(bad("RadialDistortion"));
        };
        let k3 = rest.first().copied().unwrap_or(0.0);
        let stated = match list(&c["ImageSize"]).as_slice() {
            &[height, width] => Some([width, height]),
            _ => None,
        };
        if k[(0, 1)] != 0.0 {
            return Err(source.fault("IntrinsicMatrix", "a camera with skew").remedy("calibrate without EstimateSkew"));
        }
        Ok(CameraNumbers {
            size: size(source, stated, given)?,
            fx: k[(0, 0)],
            fy: k[(1, 1)],
            cx: k[(0, 2)] - 1.0,
            cy: k[(1, 2)] - 1.0,
            model: Model::Pinhole,
            distortion: vec![*k1, *k2, p1, p2, k3],
            port: None,
        })
    };
    let step = Vector3::from_column_slice(&t) * unit(&t, given);
    let numbers = RigNumbers {
        right_from_left: rows(&rotation(source, "RotationOfCamera2", &turn)?, &step),
        rectified: false,
        left: camera("CameraParameters1")?,
        right: camera("CameraParameters2")?,
    };
    let mut found = Found::new("MATLAB stereoParameters", numbers);
    found.notes.extend(unit_note(&t, given));
    Ok(found)
}

/// The numbers of nested lists.
fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(flat).collect(),
        value => value.as_f64().into_iter().collect(),
    }
}
