//! The description of a data set, `dataset.toml`.

use std::{collections::BTreeMap, path::Path};

use seafix_component::{Fault, line_of};
use seafix_geometry::{BadCamera, Body, Camera, LensModel, NotRigid, Pinhole, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use crate::units::{doubtful_baseline, doubtful_focal};

/// The supported versions of the format. Data sets are written in the second; those with sensor readings in the third.
pub const FORMATS: [&str; 3] = ["seafix-dataset/1", "seafix-dataset/1.1", "seafix-dataset/1.2"];

/// A data set description, the content of `dataset.toml`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// The version of the format, one of [`FORMATS`].
    pub format: String,
    /// The name of the data set.
    pub name: String,
    /// The licence of its images.
    pub licence: String,
    /// The origin of the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    /// The table of stereo pairs: `stamp_ns,left,right`.
    pub frames: String,
    /// The site file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<String>,
    /// The ground truth trajectory in TUM format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<String>,
    /// The prior poses in TUM format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<String>,
    /// The standard deviations of all prior poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_sigma: Option<PriorSigma>,
    /// The table of the prior poses' covariances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_covariance: Option<String>,
    /// The table of the feature points in view: `stamp_ns,object,point`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visibility: Option<String>,
    /// The table of true object poses that differ from the survey.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objects: Option<String>,
    /// The table of Doppler velocity log readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doppler: Option<String>,
    /// The table of gyro readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<String>,
    /// The pose of the left camera in the vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_from_camera: Option<[[f64; 4]; 4]>,
    /// The number of significant bits of a pixel in images of 16 bits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits: Option<u8>,
    /// The stereo rig.
    pub rig: RigNumbers,
    /// The SHA-256 of each file, by file name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hashes: BTreeMap<String, String>,
}

/// The standard deviations of the prior poses.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorSigma {
    /// The position, per world axis (m).
    pub position: f64,
    /// The attitude, per camera axis (degrees).
    pub attitude_deg: f64,
}

/// The table `[rig]`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigNumbers {
    /// The pose of the left camera in the right camera's frame, 4 × 4 by rows.
    pub right_from_left: [[f64; 4]; 4],
    /// Whether the images are said to be rectified. The camera parameters decide; a contradiction is a warning.
    #[serde(default)]
    pub rectified: bool,
    /// The left camera.
    pub left: CameraNumbers,
    /// The right camera.
    pub right: CameraNumbers,
}

/// The table of one camera.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraNumbers {
    /// Width and height (px).
    pub size: [u32; 2],
    /// Horizontal focal length (px).
    pub fx: f64,
    /// Vertical focal length (px).
    pub fy: f64,
    /// Principal point, column (px).
    pub cx: f64,
    /// Principal point, row (px).
    pub cy: f64,
    /// The lens model.
    #[serde(default, skip_serializing_if = "Model::is_pinhole")]
    pub model: Model,
    /// The coefficients, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 of a pinhole (0, 4, 5, 8 or 12 numbers), k1 k2 k3 k4 of an
    /// equidistant lens.
    #[serde(default)]
    pub distortion: Vec<f64>,
    /// The port in front of the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<PortNumbers>,
}

/// The lens model of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// A perspective lens with Brown–Conrady distortion (`plumb_bob`, `rational_polynomial`).
    #[default]
    Pinhole,
    /// An equidistant lens (Kannala–Brandt, OpenCV's `fisheye`).
    Equidistant,
}

impl Model {
    /// The model of a lens.
    pub fn of(lens: LensModel) -> Self {
        match lens {
            LensModel::Pinhole => Self::Pinhole,
            LensModel::Equidistant => Self::Equidistant,
        }
    }

    fn is_pinhole(&self) -> bool {
        *self == Self::Pinhole
    }

    /// The camera of this model.
    ///
    /// # Errors
    /// The invalid number.
    pub fn camera(
        self,
        size: [u32; 2],
        focal: [f64; 2],
        principal: [f64; 2],
        distortion: &[f64],
    ) -> Result<Pinhole, BadCamera> {
        match self {
            Self::Pinhole => Pinhole::new(size, focal, principal, distortion),
            Self::Equidistant => Pinhole::equidistant(size, focal, principal, distortion),
        }
    }
}

/// The dome or flat port in front of a camera.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PortNumbers {
    /// The shape.
    pub kind: PortKind,
    /// The distance (m) of the calibration in water; without it the camera was calibrated in air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated_at: Option<f64>,
    /// The distance (m) from the entrance pupil to a flat port.
    #[serde(default)]
    pub distance: f64,
    /// The thickness of the glass (m).
    pub thickness: f64,
    /// The inner radius of a dome (m).
    #[serde(default)]
    pub radius: f64,
    /// The centre of a dome in the camera frame (m).
    #[serde(default)]
    pub offset: [f64; 3],
    /// The refractive index of the glass.
    pub glass: f64,
    /// The refractive index of the water.
    pub water: f64,
}

/// The shape of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PortKind {
    /// No port.
    None,
    /// A plane window.
    Flat,
    /// A spherical window.
    Dome,
}

impl PortNumbers {
    /// The distance (m) at which the camera was calibrated in water.
    ///
    /// # Errors
    /// A calibration in air: a pinhole behind a port has no valid parameters in water from it.
    pub fn calibrated_in_water(&self) -> Result<f64, String> {
        match self.calibrated_at {
            Some(range) if range > 0.0 && range.is_finite() => Ok(range),
            Some(range) => Err(format!("calibrated_at = {range}; give a distance above zero")),
            None => {
                Err("a camera calibrated in the air behind a port is not modelled; calibrate it in the water and give \
                         `calibrated_at`"
                    .to_owned())
            }
        }
    }
}

impl Description {
    /// Removes every file but images and sensor readings: site, truth, prior, visibility and objects.
    pub fn keep_pairs_only(&mut self) {
        (self.site, self.truth, self.prior, self.visibility, self.objects) = (None, None, None, None, None);
        (self.prior_sigma, self.prior_covariance) = (None, None);
    }

    /// The stereo rig of this description, read from the text `source` of `file`.
    ///
    /// # Errors
    /// The first invalid value of a camera, of a port or of the pose between the cameras.
    pub fn build_rig(&self, file: &Path, source: &str) -> Result<StereoRig, Fault> {
        self.rig.build().map_err(|(path, message)| rig_fault(file, source, &path, &message))
    }

    /// A warning if the description marks `rig` as rectified and its cameras contradict it.
    pub fn not_rectified(&self, rig: &StereoRig, file: &Path, source: &str) -> Option<Fault> {
        let odd = self.rig.rectified && !rig.is_rectified() && !rig.is_rectified_upright();
        odd.then(|| {
            Fault::new("a rig marked as rectified that is not", file)
                .on_line(line_of(source, &["rig", "rectified"]))
                .remedy("the camera parameters are used; correct `rectified` or the calibration")
        })
    }

    /// The pose of the left camera in the vehicle; the identity if the description has none.
    ///
    /// # Errors
    /// A matrix that is no rigid motion.
    pub fn mounting(&self, file: &Path, source: &str) -> Result<Transform<Body, Camera>, Fault> {
        let Some(rows) = &self.body_from_camera else { return Ok(Transform::identity()) };
        let invalid =
            |error: NotRigid| Fault::new(error.to_string(), file).on_line(line_of(source, &["body_from_camera"]));
        Transform::from_rows(rows).map_err(invalid)
    }

    /// The bit depth of images of 16 bits.
    ///
    /// # Errors
    /// A depth other than 8, 12 or 16 bits.
    pub fn depth(&self, file: &Path, source: &str) -> Result<u8, Fault> {
        match self.bits.unwrap_or(16) {
            bits @ (8 | 12 | 16) => Ok(bits),
            other => Err(Fault::new("an unsupported bit depth", file)
                .on_line(line_of(source, &["bits"]))
                .value(other)
                .remedy("give 8, 12 or 16")),
        }
    }
}

/// The fault of an invalid value below `rig.path`. The `message` is value and remedy: `fx = -1; a focal length is …`.
pub fn rig_fault(file: &Path, source: &str, path: &[&str], message: &str) -> Fault {
    let (value, remedy) = message.split_once("; ").unwrap_or((message, ""));
    let key = value.split([' ', '[']).next().filter(|key| CAMERA_KEYS.contains(key));
    let part = match *path {
        ["right_from_left"] => "pose of the right camera".to_owned(),
        [side, "port"] => format!("{side} port"),
        [side, ..] => format!("{side} camera"),
        [] => "rig".to_owned(),
    };
    let path: Vec<&str> = std::iter::once("rig").chain(path.iter().copied()).chain(key).collect();
    Fault::new(format!("an invalid {part}"), file)
        .on_line(line_of(source, &path))
        .value(value)
        .remedy(if remedy.is_empty() { "correct the calibration" } else { remedy })
}

/// The camera keys whose values are checked.
const CAMERA_KEYS: [&str; 6] = ["size", "fx", "fy", "cx", "cy", "distortion"];

impl CameraNumbers {
    /// The parameters of `camera` behind `port`.
    pub fn of(camera: &Pinhole, port: Option<PortNumbers>) -> Self {
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        let distortion = camera.distortion().shortest().to_vec();
        let model = Model::of(camera.distortion().model());
        Self { size: camera.size(), fx, fy, cx, cy, model, distortion, port }
    }
}

impl RigNumbers {
    /// The parameters of `rig` behind the ports of its left and right camera.
    pub fn of(rig: &StereoRig, [left, right]: [Option<PortNumbers>; 2]) -> Self {
        Self {
            right_from_left: rig.right_from_left().rows(),
            rectified: rig.is_rectified(),
            left: CameraNumbers::of(rig.left(), left),
            right: CameraNumbers::of(rig.right(), right),
        }
    }

    /// Builds the rig. An error is the path of the faulty key below `rig` and the message.
    pub(crate) fn build(&self) -> Result<StereoRig, (Vec<&'static str>, String)> {
        let camera = |side: &'static str, c: &CameraNumbers| {
            if let Some(port) = &c.port {
                port.calibrated_in_water().map_err(|what| (vec![side, "port"], what))?;
            }
            if let Some((what, remedy)) = doubtful_focal(c.fx, c.size[0]).filter(|_| c.model.is_pinhole()) {
                return Err((vec![side], format!("fx = {}: {what}; {remedy}", c.fx)));
            }
            c.model
                .camera(c.size, [c.fx, c.fy], [c.cx, c.cy], &c.distortion)
                .map_err(|error| (vec![side], error.to_string()))
        };
        let (left, right) = (camera("left", &self.left)?, camera("right", &self.right)?);
        let right_from_left = Transform::from_rows(&self.right_from_left)
            .map_err(|error| (vec!["right_from_left"], error.to_string()))?;
        if let Some((what, remedy)) = doubtful_baseline(right_from_left.translation().norm()) {
            return Err((vec!["right_from_left"], format!("{what}; {remedy}")));
        }
        StereoRig::new(left, right, right_from_left).map_err(|error| (vec!["right_from_left"], error.to_string()))
    }
}
