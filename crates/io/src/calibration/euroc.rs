//! EuRoC's `cam0/sensor.yaml` and `cam1/sensor.yaml`: `T_BS` = body_from_sensor.

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    text::{Source, rotation, rows},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let Some(content) = sources[0].yaml() else { return Ok(None) };
    let content = content?;
    if content["T_BS"].is_badvalue() || content["intrinsics"].is_badvalue() {
        return Ok(None);
    }
    let [left, right] = sources else {
        let fault = sources[0].fault("T_BS", "the calibration of one camera");
        return Err(fault.remedy("give both, cam0/sensor.yaml and cam1/sensor.yaml"));
    };
    let other = right.yaml().ok_or_else(|| right.fault("", "not a sensor.yaml").remedy("give cam1/sensor.yaml"))??;
    let ((l, at_l), (r, at_r)) = (pose(left, &content)?, pose(right, &other)?);
    let numbers = RigNumbers {
        right_from_left: rows(&(r.transpose() * l), &(r.transpose() * (at_l - at_r) * given.unit)),
        rectified: false,
        left: camera(left, &content)?,
        right: camera(right, &other)?,
    };
    Ok(Some(Found::new("EuRoC sensor.yaml", numbers)))
}

fn pose(source: &Source, content: &Yaml) -> Result<(Matrix3<f64>, Vector3<f64>), Fault> {
    let m = source.numbers::<16>("T_BS", &content["T_BS"])?;
    let turn = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    Ok((rotation(source, "T_BS", &turn)?, Vector3::new(m[3], m[7], m[11])))
}

fn camera(source: &Source, content: &Yaml) -> Result<CameraNumbers, Fault> {
    let model = match content["distortion_model"].as_str().unwrap_or_default() {
        "radial-tangential" | "radtan" | "plumb_bob" | "none" => Model::Pinhole,
        "equidistant" => Model::Equidistant,
        other => {
            let fault = source.fault("distortion_model", "an unsupported distortion model").value(other);
            return Err(fault.remedy("give radial-tangential or equidistant"));
        }
    };
    let [width, height] = source.numbers::<2>("resolution", &content["resolution"])?;
    let [fx, fy, cx, cy] = source.numbers::<4>("intrinsics", &content["intrinsics"])?;
    let distortion = source.list("distortion_coefficients", &content["distortion_coefficients"])?;
    Ok(CameraNumbers { size: [width as u32, height as u32], fx, fy, cx, cy, model, distortion, port: None })
}
