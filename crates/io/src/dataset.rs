//! `dataset.toml`, key by key.

use std::{collections::BTreeMap, path::Path};

use seafix_component::{Fault, line_of};
use seafix_geometry::{Body, Camera, NotRigid, Pinhole, StereoRig, Transform};
use serde::{Deserialize, Serialize};

/// The versions of the format that are read. Written is the second, or the third where there are readings.
pub const FORMATS: [&str; 3] = ["seafix-dataset/1", "seafix-dataset/1.1", "seafix-dataset/1.2"];

/// A data set description: `dataset.toml`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// The version of the format, one of [`FORMATS`].
    pub format: String,
    /// The name of the data set.
    pub name: String,
    /// The licence of its images.
    pub licence: String,
    /// Where it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    /// The table of stereo pairs: `stamp_ns,left,right`.
    pub frames: String,
    /// The site file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<String>,
    /// The true trajectory, in TUM format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<String>,
    /// The prior poses, in TUM format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<String>,
    /// Standard deviations of all prior poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_sigma: Option<PriorSigma>,
    /// A table with the covariance of each prior pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_covariance: Option<String>,
    /// A table of the feature points in view: `stamp_ns,object,point`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visibility: Option<String>,
    /// A table of true object poses that differ from the survey.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objects: Option<String>,
    /// Readings of the Doppler velocity log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doppler: Option<String>,
    /// Readings of the gyro.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<String>,
    /// The pose of the left camera in the vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_from_camera: Option<[[f64; 4]; 4]>,
    /// Significant bits of a pixel in images of 16 bits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits: Option<u8>,
    /// The stereo rig.
    pub rig: RigNumbers,
    /// SHA-256 of each file, by its name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hashes: BTreeMap<String, String>,
}

/// Standard deviations of the prior: position per world axis (m), attitude per camera axis (degrees).
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorSigma {
    /// Position, per world axis (m).
    pub position: f64,
    /// Attitude, per camera axis (degrees).
    pub attitude_deg: f64,
}

/// The table `[rig]`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigNumbers {
    /// The pose of the left camera in the right camera's frame, 4 × 4 by rows.
    pub right_from_left: [[f64; 4]; 4],
    /// Whether the images are rectified; the numbers decide.
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
    /// Plumb-bob coefficients k1 k2 p1 p2 k3 …: 0, 4, 5 or 8 numbers.
    #[serde(default)]
    pub distortion: Vec<f64>,
    /// The port in front of the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<PortNumbers>,
}

/// The dome or flat port that a camera stands behind.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PortNumbers {
    /// Its shape.
    pub kind: PortKind,
    /// Distance (m) at which the camera's numbers were found in the water; without it they are those in the air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated_at: Option<f64>,
    /// Distance (m) from the pupil to a flat port.
    #[serde(default)]
    pub distance: f64,
    /// Thickness of the glass (m).
    pub thickness: f64,
    /// Inner radius of a dome (m).
    #[serde(default)]
    pub radius: f64,
    /// Centre of a dome in the camera frame (m).
    #[serde(default)]
    pub offset: [f64; 3],
    /// Refractive index of the glass.
    pub glass: f64,
    /// Refractive index of the water.
    pub water: f64,
}

/// The shape of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PortKind {
    /// No window.
    None,
    /// A plane window.
    Flat,
    /// A spherical window.
    Dome,
}

impl PortNumbers {
    /// The distance (m) at which the camera was calibrated in the water.
    ///
    /// # Errors
    /// A calibration in the air, which a pinhole behind a port does not have in the water.
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
    /// Forgets all that is not about the motion of the rig: its images and what sensors said.
    pub fn keep_pairs_only(&mut self) {
        (self.site, self.truth, self.prior, self.visibility, self.objects) = (None, None, None, None, None);
        (self.prior_sigma, self.prior_covariance) = (None, None);
    }

    /// The stereo rig of this description, whose text is `source` in `file`.
    ///
    /// # Errors
    /// The first invalid value of a camera, of a port or of the pose between the cameras.
    pub fn build_rig(&self, file: &Path, source: &str) -> Result<StereoRig, Fault> {
        self.rig.build().map_err(|(path, message)| rig_fault(file, source, &path, &message))
    }

    /// A warning where `rig` is called rectified and is not.
    pub fn not_rectified(&self, rig: &StereoRig, file: &Path, source: &str) -> Option<Fault> {
        let odd = self.rig.rectified && !rig.is_rectified() && !rig.is_rectified_upright();
        odd.then(|| {
            Fault::new("a rig that is called rectified and is not", file)
                .on_line(line_of(source, &["rig", "rectified"]))
                .remedy("the numbers of the two cameras decide, not the word")
        })
    }

    /// The pose of the left camera in the vehicle; the identity where the description does not state it.
    ///
    /// # Errors
    /// A matrix that is no rigid motion.
    pub fn mounting(&self, file: &Path, source: &str) -> Result<Transform<Body, Camera>, Fault> {
        let Some(rows) = &self.body_from_camera else { return Ok(Transform::identity()) };
        let invalid =
            |error: NotRigid| Fault::new(error.to_string(), file).on_line(line_of(source, &["body_from_camera"]));
        Transform::from_rows(rows).map_err(invalid)
    }

    /// Depth of the pixels in images of 16 bits, or what is wrong with it.
    pub fn depth(&self, file: &Path, source: &str) -> Result<u8, Fault> {
        match self.bits.unwrap_or(16) {
            bits @ (8 | 12 | 16) => Ok(bits),
            other => Err(Fault::new("an unknown depth of pixels", file)
                .on_line(line_of(source, &["bits"]))
                .value(other)
                .remedy("8, 12 and 16 bits are read")),
        }
    }
}

/// The fault of an invalid value below `rig.path`, described as `fx = -1; a focal length is …`: the value, and its remedy.
pub fn rig_fault(file: &Path, source: &str, path: &[&str], message: &str) -> Fault {
    let (value, remedy) = message.split_once("; ").unwrap_or((message, ""));
    let key = value.split([' ', '[']).next().filter(|key| CAMERA_KEYS.contains(key));
    let part = match *path {
        ["right_from_left"] => "a pose of the right camera".to_owned(),
        [side, "port"] => format!("a {side} port"),
        [side, ..] => format!("a {side} camera"),
        [] => "a rig".to_owned(),
    };
    let path: Vec<&str> = std::iter::once("rig").chain(path.iter().copied()).chain(key).collect();
    Fault::new(format!("{part} that cannot be"), file)
        .on_line(line_of(source, &path))
        .value(value)
        .remedy(if remedy.is_empty() { "correct the calibration" } else { remedy })
}

/// Those of a camera's keys whose values are checked.
const CAMERA_KEYS: [&str; 6] = ["size", "fx", "fy", "cx", "cy", "distortion"];

impl CameraNumbers {
    /// The numbers of `camera` behind `port`.
    pub fn of(camera: &Pinhole, port: Option<PortNumbers>) -> Self {
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        let distortion = camera.distortion().shortest().to_vec();
        Self { size: camera.size(), fx, fy, cx, cy, distortion, port }
    }
}

impl RigNumbers {
    /// The numbers of `rig` behind the ports of its left and right camera.
    pub fn of(rig: &StereoRig, [left, right]: [Option<PortNumbers>; 2]) -> Self {
        Self {
            right_from_left: rig.right_from_left().rows(),
            rectified: rig.is_rectified(),
            left: CameraNumbers::of(rig.left(), left),
            right: CameraNumbers::of(rig.right(), right),
        }
    }

    /// The rig, or the path of the key at fault below `rig` and what is wrong with it.
    fn build(&self) -> Result<StereoRig, (Vec<&'static str>, String)> {
        let camera = |side: &'static str, c: &CameraNumbers| {
            if let Some(port) = &c.port {
                port.calibrated_in_water().map_err(|what| (vec![side, "port"], what))?;
            }
            Pinhole::new(c.size, [c.fx, c.fy], [c.cx, c.cy], &c.distortion)
                .map_err(|error| (vec![side], error.to_string()))
        };
        let (left, right) = (camera("left", &self.left)?, camera("right", &self.right)?);
        let right_from_left = Transform::from_rows(&self.right_from_left)
            .map_err(|error| (vec!["right_from_left"], error.to_string()))?;
        StereoRig::new(left, right, right_from_left).map_err(|error| (vec!["right_from_left"], error.to_string()))
    }
}
