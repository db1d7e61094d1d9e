//! Kalibr's `camchain.yaml`: `cam0`, `cam1`, with `T_cn_cnm1` = cam1_from_cam0 or `T_cam_imu` of both.

use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    text::{Source, inverse, motion, rows},
};
use crate::dataset::{CameraNumbers, Model, RigNumbers};
use nalgebra::{Matrix3, Vector3};

/// The words that head the cameras in Kalibr's report, `…-results-cam.txt`.
pub(super) const REPORT: &str = "Camera-system parameters";

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    if source.text.contains(REPORT) {
        let fault = source.fault(REPORT, "a report of Kalibr, which is not the calibration");
        return Err(fault.remedy("give the camchain (yaml) that Kalibr wrote beside it"));
    }
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
    let (turn, step) = pose(source, &content["cam0"], other)?;
    let numbers = RigNumbers {
        right_from_left: rows(&turn, &(step * given.unit)),
        rectified: false,
        left: camera(source, "cam0", &content["cam0"])?,
        right: camera(source, "cam1", other)?,
    };
    let mut found = Found::new("Kalibr camchain", numbers);
    let more = (2..).take_while(|index| !content[format!("cam{index}").as_str()].is_badvalue()).count();
    if more > 0 {
        found.notes.push(format!("cam0 and cam1 of {} cameras, as left and right", more + 2));
    }
    Ok(Some(found))
}

/// The rotation and the translation of cam1_from_cam0: `T_cn_cnm1`, or by way of the IMU, `T_cam_imu` of both cameras,
/// or its inverse, `T_imu_cam`, as OpenVINS writes it.
fn pose(source: &Source, left: &Yaml, right: &Yaml) -> Result<(Matrix3<f64>, Vector3<f64>), Fault> {
    let of = |key: &str, value: &Yaml| motion(source, key, &source.numbers::<16>(key, value)?);
    if !right["T_cn_cnm1"].is_badvalue() {
        return of("T_cn_cnm1", &right["T_cn_cnm1"]);
    }
    let from_imu = |camera: &Yaml| match (&camera["T_cam_imu"], &camera["T_imu_cam"]) {
        (value, Yaml::BadValue) if !value.is_badvalue() => of("T_cam_imu", value),
        (Yaml::BadValue, value) if !value.is_badvalue() => of("T_imu_cam", value).map(inverse),
        _ => {
            let fault = source.fault("cam1", "no pose of the second camera");
            Err(fault.remedy(
                "give `T_cn_cnm1` of cam1 (cam1_from_cam0), or `T_cam_imu` of both cameras, or `T_imu_cam` of both",
            ))
        }
    };
    let (left_from_imu, (right_turn, right_step)) = (from_imu(left)?, from_imu(right)?);
    let (turn, step) = inverse(left_from_imu);
    Ok((right_turn * turn, right_turn * step + right_step))
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
