//! The settings of ORB-SLAM2 and ORB-SLAM3: `Camera1.fx` … and `Stereo.T_c1_c2` (left_from_right), `Camera.bf` of
//! rectified images, or `LEFT.K` … `RIGHT.P` of raw ones.

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    text::{Source, camera, inverse, matrix, motion, rotation, rows, size},
};
use crate::{
    dataset::{CameraNumbers, Model, RigNumbers},
    yaml,
};

const FORMAT: &str = "settings of ORB-SLAM";

/// The remedy for settings of a single camera.
const ONE_CAMERA: &str = "give those of a stereo rig: `Camera2.fx` and `Stereo.T_c1_c2`, or `Camera.type: \"Rectified\"` and \
                          `Stereo.b`, or `LEFT.K` … `RIGHT.P`";

/// Whether a text is that of such settings.
pub(super) fn is_one(text: &str) -> bool {
    text.contains("Camera1.fx") || text.contains("Camera.fx") || text.contains("Camera.type")
}

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let source = &sources[0];
    if !is_one(&source.text) {
        return Ok(None);
    }
    let Some(content) = source.yaml() else { return Ok(None) };
    let settings = Settings { source, content: content? };
    let camera_type = settings.content["Camera.type"].as_str().unwrap_or("PinHole").to_owned();
    let numbers = if settings.has("LEFT.K") {
        settings.raw(given)?
    } else if camera_type == "Rectified" || !settings.has("Camera2.fx") {
        settings.rectified(given, &camera_type)?
    } else {
        settings.pair(given, &camera_type)?
    };
    let mut found = Found::new(FORMAT, numbers);
    found.notes.push(if found.numbers.rectified { "of rectified images" } else { "of raw images" }.to_owned());
    Ok(Some(found))
}

struct Settings<'a> {
    source: &'a Source,
    content: Yaml,
}

impl Settings<'_> {
    fn has(&self, key: &str) -> bool {
        !self.content[key].is_badvalue()
    }

    fn number(&self, key: &str) -> Result<f64, Fault> {
        yaml::number(&self.content[key]).ok_or_else(|| {
            self.source.fault(key, format!("no number `{key}`")).remedy("give the settings of a stereo rig")
        })
    }

    fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], Fault> {
        self.source.numbers::<N>(key, &self.content[key])
    }

    fn size(&self, given: Given) -> Result<[u32; 2], Fault> {
        let stated = self.number("Camera.width").and_then(|width| Ok([width, self.number("Camera.height")?])).ok();
        size(self.source, stated, given)
    }

    /// The camera of the keys `PREFIX.fx` …: without its coefficients for rectified images, to which they do not apply.
    fn camera(&self, prefix: &str, kind: &str, given: Given, distorted: bool) -> Result<CameraNumbers, Fault> {
        let key = |name: &str| format!("{prefix}.{name}");
        let number = |name: &str| self.number(&key(name));
        let k = [number("fx")?, 0.0, number("cx")?, 0.0, number("fy")?, number("cy")?, 0.0, 0.0, 1.0];
        let (model, names): (Model, &[&str]) = match kind {
            "PinHole" | "Pinhole" | "Rectified" => (Model::Pinhole, &["k1", "k2", "p1", "p2", "k3"]),
            "KannalaBrandt8" => (Model::Equidistant, &["k1", "k2", "k3", "k4"]),
            other => {
                let fault = self.source.fault("Camera.type", "an unsupported camera model").value(other);
                return Err(fault.remedy("give PinHole, KannalaBrandt8 or Rectified"));
            }
        };
        // A coefficient that is not stated is zero.
        let all: Vec<f64> =
            names.iter().map(|name| yaml::number(&self.content[key(name).as_str()]).unwrap_or(0.0)).collect();
        camera(self.source, self.size(given)?, &k, model, if distorted { all } else { Vec::new() })
    }

    /// Two cameras with the pose of the second in the first, under its new or its old name.
    fn pair(&self, given: Given, kind: &str) -> Result<RigNumbers, Fault> {
        let Some(name) = ["Stereo.T_c1_c2", "Tlr"].into_iter().find(|name| self.has(name)) else {
            let fault = self.source.fault("Camera2.fx", "no pose of the second camera");
            return Err(fault.remedy("give `Stereo.T_c1_c2` (left_from_right, 4×4)"));
        };
        let left = if self.has("Camera1.fx") { "Camera1" } else { "Camera" };
        let (turn, step) = inverse(motion(self.source, name, &self.source.list(name, &self.content[name])?)?);
        Ok(RigNumbers {
            right_from_left: rows(&turn, &(step * given.unit)),
            rectified: false,
            left: self.camera(left, kind, given, true)?,
            right: self.camera("Camera2", kind, given, true)?,
        })
    }

    /// Rectified images: one camera and the baseline, in metres or times fx.
    fn rectified(&self, given: Given, kind: &str) -> Result<RigNumbers, Fault> {
        let left = if self.has("Camera1.fx") { "Camera1" } else { "Camera" };
        let camera = self.camera(left, kind, given, false)?;
        let stated = self.camera(left, kind, given, true)?;
        if kind != "Rectified" && stated.distortion.iter().any(|k| *k != 0.0) {
            let fault = self.source.fault(&format!("{left}.k1"), "coefficients of one camera without the other");
            return Err(fault.remedy(ONE_CAMERA));
        }
        let is_depth = self
            .content
            .as_hash()
            .is_some_and(|all| all.keys().any(|key| key.as_str().is_some_and(|key| key.ends_with("DepthMapFactor"))));
        let baseline = match (self.number("Stereo.b"), self.number("Camera.bf")) {
            (Ok(baseline), _) => baseline,
            (_, Ok(product)) => product / camera.fx,
            _ => f64::NAN,
        };
        if is_depth || !baseline.is_finite() {
            let fault =
                self.source.fault("", "settings of one camera").value(if is_depth { "RGB-D" } else { "monocular" });
            return Err(
                fault.remedy("give those of a stereo rig, with `Camera2.fx` and `Stereo.T_c1_c2`, or `Stereo.b`")
            );
        }
        let step = Vector3::new(-baseline * given.unit, 0.0, 0.0);
        Ok(RigNumbers {
            right_from_left: rows(&Matrix3::identity(), &step),
            rectified: true,
            left: camera.clone(),
            right: camera,
        })
    }

    /// Raw images with the matrices that rectify them, x_rect = R x, and P = K [I | t].
    fn raw(&self, given: Given) -> Result<RigNumbers, Fault> {
        let turn = |key: &str| rotation(self.source, key, &matrix(&self.numbers::<9>(key)?));
        let (left, right, p) = (turn("LEFT.R")?, turn("RIGHT.R")?, self.numbers::<12>("RIGHT.P")?);
        let between = Vector3::new(p[3] / p[0], 0.0, 0.0) * given.unit;
        let camera = |side: &str| {
            let d = format!("{side}.D");
            let coefficients = self.source.list(&d, &self.content[d.as_str()])?;
            camera(
                self.source,
                self.size(given)?,
                &self.numbers::<9>(&format!("{side}.K"))?,
                Model::Pinhole,
                coefficients,
            )
        };
        Ok(RigNumbers {
            right_from_left: rows(&(right.transpose() * left), &(right.transpose() * between)),
            rectified: false,
            left: camera("LEFT")?,
            right: camera("RIGHT")?,
        })
    }
}
