//! Two `CameraInfo`s as a rig.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use seafix_geometry::{Camera, Pinhole, RightCamera, Transform};
use serde::{Deserialize, Serialize};

use super::CameraInfo;

/// Which images the recording has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Views {
    /// Rectified where the topic's name says so (`image_rect`), else as the camera gave them.
    #[default]
    ByName,
    /// As the camera gave them: K and D hold.
    Raw,
    /// Rectified: P holds.
    Rectified,
}

impl Views {
    /// Whether the images on this topic are rectified.
    pub(crate) fn rectified(self, topic: &str) -> bool {
        match self {
            Self::ByName => topic.contains("rect") && !topic.contains("unrect"),
            Self::Raw => false,
            Self::Rectified => true,
        }
    }
}

/// The camera that took the images.
pub(crate) fn camera(info: &CameraInfo, rectified: bool) -> Result<Pinhole, String> {
    if info.binning.iter().any(|&binning| binning > 1)
        || info.region != [0; 4] && info.region[2..] != [info.size[1], info.size[0]]
    {
        return Err("images of a part of the sensor, or binned, are not read".to_owned());
    }
    let [fx, _, cx, _, fy, cy, ..] = info.k;
    let [px, _, pcx, _, _, py, pcy, ..] = info.p;
    let distortion: &[f64] = if info.d.iter().all(|&number| number == 0.0) { &[] } else { &info.d };
    let built = match (rectified, info.model.as_str()) {
        (true, _) => Pinhole::new(info.size, [px, py], [pcx, pcy], &[]),
        (false, "plumb_bob" | "rational_polynomial" | "") => Pinhole::new(info.size, [fx, fy], [cx, cy], distortion),
        (false, _) if distortion.is_empty() => Pinhole::new(info.size, [fx, fy], [cx, cy], &[]),
        (false, other) => {
            return Err(format!("the distortion model `{other}` is not read; plumb_bob and rational_polynomial are"));
        }
    };
    built.map_err(|error| error.to_string())
}

/// Where the cameras stand, as their calibration has it: `P = K [I | t]` in the frames that R turns them into;
/// `None` where it says nothing.
pub(crate) fn right_from_left(
    left: &CameraInfo,
    right: &CameraInfo,
    rectified: bool,
) -> Result<Option<Transform<RightCamera, Camera>>, String> {
    let shift = |info: &CameraInfo| {
        let [fx, _, cx, tx, _, fy, cy, ty, _, _, _, tz] = info.p;
        Vector3::new((tx - cx * tz) / fx, (ty - cy * tz) / fy, tz)
    };
    let between = shift(right) - shift(left);
    if !(between.norm() > 0.0 && between.iter().all(|t| t.is_finite())) {
        return Ok(None);
    }
    if rectified {
        return Ok(Some(Transform::new(UnitQuaternion::identity(), between)));
    }
    let turn = |info: &CameraInfo| {
        let r = Matrix3::from_row_slice(&info.r);
        let off = (r.transpose() * r - Matrix3::identity()).amax();
        if off > 1e-6 { Err(format!("R is off orthonormal by {off:.1e}")) } else { Ok(r) }
    };
    // x_rect = R x in either camera, and the right one sees the left one's x_rect at x_rect + t.
    let (left, right) = (turn(left)?, turn(right)?);
    Ok(Some(Transform::from_axes(&(right.transpose() * left), right.transpose() * between)))
}
