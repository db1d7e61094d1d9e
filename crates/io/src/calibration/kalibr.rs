//! Kalibr's `camchain.yaml`: `cam0`, `cam1`, with `T_cn_cnm1` = cam1_from_cam0.

use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    text::{Source, rotation, rows},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};
use nalgebra::{Matrix3, Vector3};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    let Some(content) = source.yaml() else { return Ok(None) };
    let content = content?;
    if content["cam0"]["camera_model"].is_badvalue() {
        return Ok(None);
    }
    let other = &content["cam1"];
    if other["camera_model"].is_badvalue() {
        return Err(source
            .fault("cam0", "one camera only")
            .remedy("give the camchain of a stereo calibration, with `cam1`"));
    }
    let pose = source.numbers::<16>("T_cn_cnm1", &other["T_cn_cnm1"])?;
    let turn = Matrix3::new(pose[0], pose[1], pose[2], pose[4], pose[5], pose[6], pose[8], pose[9], pose[10]);
    let step = Vector3::new(pose[3], pose[7], pose[11]) * given.unit;
    let numbers = RigNumbers {
        right_from_left: rows(&rotation(source, "T_cn_cnm1", &turn)?, &step),
        rectified: false,
        left: camera(source, "cam0", &content["cam0"])?,
        right: camera(source, "cam1", other)?,
    };
    Ok(Some(Found::new("Kalibr camchain", numbers)))
}

fn camera(source: &Source, name: &str, camera: &Yaml) -> Result<CameraNumbers, Fault> {
    let word = |key: &str| camera[key].as_str().unwrap_or_default().to_owned();
    if word("camera_model") != "pinhole" {
        let fault = source.fault(&word("camera_model"), format!("{name} has an unsupported camera model"));
        return Err(fault.value(word("camera_model")).remedy("calibrate as pinhole-radtan or pinhole-equi"));
    }
    let model = match word("distortion_model").as_str() {
        "radtan" | "plumb_bob" | "none" => Model::Pinhole,
        "equidistant" | "equi" => Model::Equidistant,
        other => {
            let fault = source.fault(other, format!("{name} has an unsupported distortion model"));
            return Err(fault.value(other).remedy("calibrate as pinhole-radtan or pinhole-equi"));
        }
    };
    let [width, height] = source.numbers::<2>("resolution", &camera["resolution"])?;
    let [fx, fy, cx, cy] = source.numbers::<4>("intrinsics", &camera["intrinsics"])?;
    let distortion = source.list("distortion_coeffs", &camera["distortion_coeffs"])?;
    Ok(CameraNumbers { size: [width as u32, height as u32], fx, fy, cx, cy, model, distortion, port: None })
}
