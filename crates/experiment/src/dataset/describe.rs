//! `dataset.toml`, key by key.

use std::{collections::BTreeMap, path::Path};

use seafix_component::{Fault, line_of};
use seafix_geometry::{Pinhole, StereoRig, Transform};
use serde::{Deserialize, Serialize};

/// The versions of the format that are read; the last is written.
pub(super) const FORMATS: [&str; 2] = ["seafix-dataset/1", "seafix-dataset/1.1"];

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
    /// A dome or flat port; read so that such a set is refused by name instead of by an unknown key.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) port: Option<toml::Table>,
}

impl Description {
    /// Forgets all that is not about the rig and its images.
    pub(super) fn keep_pairs_only(&mut self) {
        (self.site, self.truth, self.prior, self.visibility, self.objects) = (None, None, None, None, None);
        (self.prior_sigma, self.prior_covariance) = (None, None);
    }

    /// The rig, or what is wrong with it in `file`, whose text is `source`.
    pub(super) fn build_rig(&self, file: &Path, source: &str) -> Result<StereoRig, Fault> {
        self.rig.build().map_err(|(path, what)| {
            let path: Vec<&str> = std::iter::once("rig").chain(path).collect();
            Fault::new(what, file).on_line(line_of(source, &path))
        })
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

impl CameraNumbers {
    pub(super) fn of(camera: &Pinhole) -> Self {
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        Self { size: camera.size(), fx, fy, cx, cy, distortion: camera.distortion().shortest().to_vec(), port: None }
    }
}

impl Rig {
    pub(super) fn of(rig: &StereoRig) -> Self {
        Self {
            right_from_left: rig.right_from_left().rows(),
            rectified: rig.is_rectified(),
            left: CameraNumbers::of(rig.left()),
            right: CameraNumbers::of(rig.right()),
        }
    }

    /// The rig, or the path of the key at fault below `rig` and what is wrong with it.
    fn build(&self) -> Result<StereoRig, (Vec<&'static str>, String)> {
        let camera = |side: &'static str, c: &CameraNumbers| {
            if c.port.is_some() {
                return Err((vec![side, "port"], "views through a dome or flat port are not read yet".to_owned()));
            }
            Pinhole::new(c.size, [c.fx, c.fy], [c.cx, c.cy], &c.distortion)
                .map_err(|error| (vec![side], format!("{side} camera: {error}")))
        };
        let (left, right) = (camera("left", &self.left)?, camera("right", &self.right)?);
        let right_from_left = Transform::from_rows(&self.right_from_left)
            .map_err(|error| (vec!["right_from_left"], error.to_string()))?;
        StereoRig::new(left, right, right_from_left).map_err(|error| (vec!["right_from_left"], error.to_string()))
    }
}
