//! A stereo rig from two `CameraInfo` messages.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use seafix_component::Settings;
use seafix_geometry::{Camera, Pinhole, RightCamera, Transform};
use serde::{Deserialize, Serialize};

use super::messages::CameraInfo;

/// The kind of the images in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Views {
    /// Decided by the calibration, and where it allows both, by the distances of matches to the epipolar lines.
    #[default]
    #[serde(alias = "by-name")]
    Auto,
    /// Raw images: K and D apply.
    Raw,
    /// Rectified images: P applies.
    Rectified,
}

/// The greatest skew of a camera, as a part of its focal length: the rounding of six digits.
const SKEW: f64 = 1e-6;

/// Whether K is no camera, so that images can only be rectified.
pub(crate) fn is_without_raw_model(info: &CameraInfo) -> bool {
    info.k[0] == 0.0
}

/// Whether neither K nor P is a camera: drivers publish zeros until a camera is calibrated.
pub(crate) fn is_uncalibrated(info: &CameraInfo) -> bool {
    info.k[0] == 0.0 && info.p[0] == 0.0
}

/// The camera model of the images.
pub(crate) fn camera(info: &CameraInfo, rectified: bool) -> Result<Pinhole, String> {
    if info.binning.iter().any(|&binning| binning > 1)
        || info.region != [0; 4] && info.region[2..] != [info.size[1], info.size[0]]
    {
        return Err("a region of interest or binning is not supported; record full images".to_owned());
    }
    let [fx, skew, cx, _, fy, cy, ..] = info.k;
    if !rectified && skew.abs() > SKEW * fx.abs() {
        return Err(format!("K has a skew of {skew}; calibrate without skew, or set images = \"rectified\""));
    }
    let [px, _, pcx, _, _, py, pcy, ..] = info.p;
    let distortion: &[f64] = if info.d.iter().all(|&number| number == 0.0) { &[] } else { &info.d };
    let built = match (rectified, info.model.as_str()) {
        (true, _) => Pinhole::new(info.size, [px, py], [pcx, pcy], &[]),
        (false, "plumb_bob" | "rational_polynomial") => Pinhole::new(info.size, [fx, fy], [cx, cy], distortion),
        // Drivers of images without distortion state `none` or nothing, with zeros or without numbers.
        (false, "none" | "None" | "") if distortion.is_empty() => Pinhole::new(info.size, [fx, fy], [cx, cy], &[]),
        (false, nothing @ ("none" | "None" | "")) => {
            let remedy = "record plumb_bob, rational_polynomial or equidistant, or set images = \"rectified\"";
            return Err(format!("the distortion model is `{nothing}`, but D has {} numbers; {remedy}", info.d.len()));
        }
        (false, "equidistant" | "fisheye" | "kannala_brandt" | "kannala_brandt4") => {
            Pinhole::equidistant(info.size, [fx, fy], [cx, cy], &info.d)
        }
        (false, other) => {
            let read = "use plumb_bob, rational_polynomial or equidistant";
            let remedy = "or rectify the images and set images = \"rectified\"";
            return Err(format!("the distortion model `{other}` is not supported; {read}, {remedy}"));
        }
    };
    built.map_err(|error| error.to_string())
}

/// The transform between the cameras by calibration: `P = K [I | t]` in the frames that R rotates them into; `None` if
/// P has no baseline.
pub(crate) fn right_from_left(
    left: &CameraInfo,
    right: &CameraInfo,
    rectified: bool,
) -> Result<Option<Transform<RightCamera, Camera>>, String> {
    for info in [left, right] {
        let [fx, skew, _, _, other, _, _, _, a, b, ..] = info.p;
        if fx != 0.0 && ![skew, other, a, b].iter().all(|part| part.abs() <= SKEW * fx.abs()) {
            return Err(
                "P is not of the form K [I | t], but has skew or rotation; publish P of rectified cameras".to_owned()
            );
        }
    }
    let Some(between) = baseline(left, right) else { return Ok(None) };
    if rectified {
        return Ok(Some(Transform::new(UnitQuaternion::identity(), between)));
    }
    let (left, right) = (turn(left)?, turn(right)?);
    Ok(Some(raw(&left, &right, &between)))
}

/// The left camera's centre in the rectified right view (m), from P = K [I | t]; `None` if both centres coincide.
fn baseline(left: &CameraInfo, right: &CameraInfo) -> Option<Vector3<f64>> {
    let shift = |info: &CameraInfo| {
        let [fx, _, cx, tx, _, fy, cy, ty, _, _, _, tz] = info.p;
        Vector3::new((tx - cx * tz) / fx, (ty - cy * tz) / fy, tz)
    };
    let between = shift(right) - shift(left);
    (between.norm() > 0.0 && between.iter().all(|t| t.is_finite())).then_some(between)
}

/// The rotation R, x_rect = R x.
fn turn(info: &CameraInfo) -> Result<Matrix3<f64>, String> {
    let r = Matrix3::from_row_slice(&info.r);
    let off = (r.transpose() * r - Matrix3::identity()).amax();
    if off > 1e-6 { Err(format!("R is off orthonormal by {off:.1e}")) } else { Ok(r) }
}

/// The transform between the mounted cameras: the right one sees the left one's x_rect at x_rect + t.
fn raw(left: &Matrix3<f64>, right: &Matrix3<f64>, between: &Vector3<f64>) -> Transform<RightCamera, Camera> {
    Transform::from_axes(&(right.transpose() * left), right.transpose() * between)
}

/// The relative tolerance of the baseline between a calibration and a drawing of one rig.
const SAME_LENGTH: f64 = 0.01;
/// The tolerance of directions (rad).
const SAME_DIRECTION: f64 = 0.1;

/// The contradiction between the transforms and P about the right camera's pose; `None` if they agree. The frames of
/// the transforms may be those of the mounted cameras or of the rectified views.
pub(crate) fn contradiction(
    left: &CameraInfo,
    right: &CameraInfo,
    stands: &Transform<RightCamera, Camera>,
) -> Result<Option<String>, String> {
    let Some(between) = baseline(left, right) else { return Ok(None) };
    let rectified = Transform::new(UnitQuaternion::identity(), between);
    // An R of zeros belongs to a camera that was not rectified.
    let mounted = turn(left).and_then(|l| Ok(raw(&l, &turn(right)?, &between))).ok();
    let agrees = |p: &Transform<RightCamera, Camera>| {
        let (a, b) = (p.translation(), stands.translation());
        (a.norm() - b.norm()).abs() <= SAME_LENGTH * a.norm()
            && a.angle(&b) <= SAME_DIRECTION
            && p.rotation().angle_to(&stands.rotation()) <= SAME_DIRECTION
    };
    if agrees(&rectified) || mounted.as_ref().is_some_and(agrees) {
        return Ok(None);
    }
    let message = |t: &Vector3<f64>, turned: f64| {
        let turned = if turned > 1e-3 { format!(", turned by {:.1}°", turned.to_degrees()) } else { String::new() };
        format!("{:.4} m at [{:.3}, {:.3}, {:.3}]{turned}", t.norm(), t.x, t.y, t.z)
    };
    let p = mounted.unwrap_or(rectified);
    let of = |which: &Transform<RightCamera, Camera>| message(&which.translation(), which.rotation().angle());
    Ok(Some(format!("P gives {}, /tf {}", of(&p), of(stands))))
}
