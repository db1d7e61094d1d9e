//! `dataset.toml`, key by key.

use std::{collections::BTreeMap, path::Path};

use seafix_component::{Fault, line_of};
use seafix_geometry::{Pinhole, StereoRig, Transform};
use seafix_simulation::optics::{Port, PortKind};
use serde::{Deserialize, Serialize};

use crate::source::CalibratedPort;

/// The versions of the format that are read. Written is the second, or the third where there are readings.
pub(super) const FORMATS: [&str; 3] = ["seafix-dataset/1", "seafix-dataset/1.1", "seafix-dataset/1.2"];

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    pub(super) format: String,
    pub(super) name: String,
    pub(super) licence: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) origin: Option<String>,
    pub(super) frames: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) site: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) truth: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) prior: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) prior_sigma: Option<PriorSigma>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) prior_covariance: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) visibility: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) objects: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) doppler: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) gyro: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) body_from_camera: Option<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) bits: Option<u8>,
    pub(super) rig: Rig,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) hashes: BTreeMap<String, String>,
}

/// Standard deviations of the prior: position per world axis (m), attitude per camera axis (degrees).
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorSigma {
    pub(super) position: f64,
    pub(super) attitude_deg: f64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rig {
    pub(super) right_from_left: [[f64; 4]; 4],
    #[serde(default)]
    pub(super) rectified: bool,
    pub(super) left: CameraNumbers,
    pub(super) right: CameraNumbers,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraNumbers {
    pub(super) size: [u32; 2],
    pub(super) fx: f64,
    pub(super) fy: f64,
    pub(super) cx: f64,
    pub(super) cy: f64,
    #[serde(default)]
    pub(super) distortion: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) port: Option<PortNumbers>,
}

/// The dome or flat port that a camera stands behind.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PortNumbers {
    pub(super) kind: PortKind,
    /// Distance (m) at which the camera's numbers were found in the water; without it they are those in the air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) calibrated_at: Option<f64>,
    /// From the pupil to a flat port, thickness of the glass, inner radius of a dome and its centre in the camera's
    /// frame (m); refractive indices of glass and water.
    #[serde(default)]
    pub(super) distance: f64,
    pub(super) thickness: f64,
    #[serde(default)]
    pub(super) radius: f64,
    #[serde(default)]
    pub(super) offset: [f64; 3],
    pub(super) glass: f64,
    pub(super) water: f64,
}

impl PortNumbers {
    fn of(behind: &CalibratedPort) -> Self {
        let Port { kind, distance, thickness, radius, offset, glass, water } = behind.port;
        Self { kind, calibrated_at: Some(behind.range), distance, thickness, radius, offset, glass, water }
    }

    fn build(&self) -> Result<CalibratedPort, String> {
        let Self { kind, distance, thickness, radius, offset, glass, water, .. } = *self;
        let port = Port { kind, distance, thickness, radius, offset, glass, water };
        // A flat port has no radius to be wrong.
        let checked = if kind == PortKind::Flat { Port { radius: 1.0, ..port.clone() } } else { port.clone() };
        checked.check()?;
        match self.calibrated_at {
            Some(range) if range > 0.0 && range.is_finite() => Ok(CalibratedPort { port, range }),
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
    pub(super) fn keep_pairs_only(&mut self) {
        (self.site, self.truth, self.prior, self.visibility, self.objects) = (None, None, None, None, None);
        (self.prior_sigma, self.prior_covariance) = (None, None);
    }

    /// The rig, or what is wrong with it in `file`, whose text is `source`.
    pub(super) fn build_rig(&self, file: &Path, source: &str) -> Result<StereoRig, Fault> {
        self.rig.build().map_err(|(path, said)| {
            // Said as `fx = -1; a focal length is …`: the value, and what it should be.
            let (value, remedy) = said.split_once("; ").unwrap_or((&said, ""));
            let key = value.split([' ', '[']).next().filter(|key| CAMERA_KEYS.contains(key));
            let part = match path[..] {
                ["right_from_left"] => "a pose of the right camera".to_owned(),
                [side, "port"] => format!("a {side} port"),
                _ => format!("a {} camera", path[0]),
            };
            let path: Vec<&str> = std::iter::once("rig").chain(path).chain(key).collect();
            Fault::new(format!("{part} that cannot be"), file)
                .on_line(line_of(source, &path))
                .value(value)
                .remedy(if remedy.is_empty() { "correct the calibration" } else { remedy })
        })
    }

    /// A warning where `rig` is called rectified and is not.
    pub(super) fn not_rectified(&self, rig: &StereoRig, file: &Path, source: &str) -> Option<Fault> {
        let odd = self.rig.rectified && !rig.is_rectified() && !rig.is_rectified_upright();
        odd.then(|| {
            Fault::new("a rig that is called rectified and is not", file)
                .on_line(line_of(source, &["rig", "rectified"]))
                .remedy("the numbers of the two cameras decide, not the word")
        })
    }

    /// The ports of the two cameras; those of a rig that was built are in order.
    pub(super) fn ports(&self) -> [Option<CalibratedPort>; 2] {
        [&self.rig.left, &self.rig.right].map(|camera| camera.port.as_ref().and_then(|port| port.build().ok()))
    }

    /// Depth of the pixels in images of 16 bits, or what is wrong with it.
    pub(super) fn depth(&self, file: &Path, source: &str) -> Result<u8, Fault> {
        match self.bits.unwrap_or(16) {
            bits @ (8 | 12 | 16) => Ok(bits),
            other => Err(Fault::new("an unknown depth of pixels", file)
                .on_line(line_of(source, &["bits"]))
                .value(other)
                .remedy("8, 12 and 16 bits are read")),
        }
    }
}

/// Those of a camera's keys whose values are checked.
const CAMERA_KEYS: [&str; 6] = ["size", "fx", "fy", "cx", "cy", "distortion"];

impl CameraNumbers {
    pub(super) fn of(camera: &Pinhole, port: Option<&CalibratedPort>) -> Self {
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        Self {
            size: camera.size(),
            fx,
            fy,
            cx,
            cy,
            distortion: camera.distortion().shortest().to_vec(),
            port: port.map(PortNumbers::of),
        }
    }
}

impl Rig {
    pub(super) fn of(rig: &StereoRig, [left, right]: [Option<CalibratedPort>; 2]) -> Self {
        Self {
            right_from_left: rig.right_from_left().rows(),
            rectified: rig.is_rectified(),
            left: CameraNumbers::of(rig.left(), left.as_ref()),
            right: CameraNumbers::of(rig.right(), right.as_ref()),
        }
    }

    /// The rig, or the path of the key at fault below `rig` and what is wrong with it.
    fn build(&self) -> Result<StereoRig, (Vec<&'static str>, String)> {
        let camera = |side: &'static str, c: &CameraNumbers| {
            if let Some(port) = &c.port {
                port.build().map_err(|what| (vec![side, "port"], what))?;
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
