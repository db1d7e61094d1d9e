//! EuRoC data sets (ASL format): `mav0/cam0`, `mav0/cam1`, each with a `sensor.yaml`, a `data.csv` and its images in
//! `data`; the truth in `mav0/state_groundtruth_estimate0`.
//!
//! The matrix `T_BS` of a sensor is `body_from_sensor`. A line of the truth is the pose of its own sensor in the
//! reference frame.

use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;
use seafix_component::{Fault, read_text};
use seafix_geometry::{Body, Camera, Frame, Pinhole, StereoRig, Transform, World};
use seafix_io::yaml;
use yaml_rust2::Yaml;

use super::{
    contents::{Dataset, DatasetFrame},
    foreign::{Foreign, image},
    pairing::{SAME_INSTANT_NS, constant_offset, left_out, pairs},
    tum::{Stamped, between},
};
use crate::trajectory::Trajectory;

/// The maximum gap between lines of the truth for interpolation (ns).
const MAX_GAP_NS: u64 = 50_000_000;
const CAMERAS: [&str; 2] = ["cam0", "cam1"];
const TRUTH: &str = "state_groundtruth_estimate0";

/// The folder with the sensors, if `folder` is an EuRoC data set or its `mav0`.
pub(super) fn home(folder: &Path) -> Option<PathBuf> {
    [folder.join("mav0"), folder.to_owned()].into_iter().find(|home| home.join("cam0").is_dir())
}

/// Reads the data set whose sensors are in `home`.
pub(super) fn read(folder: &Path, home: &Path, pairs_only: bool) -> Result<Dataset, Vec<Fault>> {
    let below = home.strip_prefix(folder).unwrap_or(Path::new(""));
    let mut faults = Vec::new();
    let mut each = |side: usize| {
        let sensor = home.join(CAMERAS[side]);
        let camera = camera(&sensor).map_err(|fault| faults.push(fault)).ok();
        let images = images(&sensor).map_err(|fault| faults.push(fault)).ok();
        Some((camera?, images?))
    };
    let (left, right) = (each(0), each(1));
    let (Some((left, left_images)), Some((right, right_images))) = (left, right) else { return Err(faults) };
    let right_from_left = (right.body_from_sensor.inverse() * left.body_from_sensor).relabel();
    let rig = StereoRig::new(left.camera, right.camera, right_from_left)
        .map_err(|error| vec![Fault::new(error.to_string(), &home.join("cam1/sensor.yaml"))])?;
    let stamps = [&left_images, &right_images].map(|images| images.iter().map(|image| image.0).collect::<Vec<u64>>());
    let pairs = pairs(&stamps[0], &stamps[1], SAME_INSTANT_NS);
    let tables = CAMERAS.map(|camera| home.join(camera).join("data.csv"));
    let mut warnings = Vec::new();
    match left_out(pairs.len(), [stamps[0].len(), stamps[1].len()], &tables[0]) {
        Ok(warning) => warnings.extend(warning),
        Err(fault) => {
            let remedy = "stamp both images of a pair alike, or list the pairs in the frames.csv of a dataset.toml";
            let offset = constant_offset(&stamps[0], &stamps[1], &tables[1]).map(|offset| offset.remedy(remedy));
            faults.push(offset.unwrap_or(fault));
        }
    }
    let truth = if pairs_only { Ok(Vec::new()) } else { truth(home, &left.body_from_sensor) };
    let truth = truth.map_err(|fault| faults.push(fault)).unwrap_or_default();
    let mut frames = Vec::with_capacity(pairs.len());
    for (i, j) in pairs {
        let mut place = |side: usize, (_, line, name): &(u64, usize, String)| {
            let name = below.join(CAMERAS[side]).join("data").join(name);
            let found = image(folder, &name.to_string_lossy(), &tables[side], pairs_only);
            found.map_err(|fault| faults.push(fault.on_line(*line))).ok()
        };
        let (Some(left), Some(right)) = (place(0, &left_images[i]), place(1, &right_images[j])) else { continue };
        let stamp_ns = left_images[i].0;
        let truth = between(&truth, stamp_ns, MAX_GAP_NS);
        frames.push(DatasetFrame { stamp_ns, left, right, truth, prior: None, visible: Vec::new() });
    }
    if !truth.is_empty() && frames.iter().any(|frame| frame.truth.is_none()) {
        let without = frames.iter().filter(|frame| frame.truth.is_none()).count();
        let fault = Fault::new("stereo pairs without a truth", &home.join(TRUTH).join("data.csv"));
        warnings.push(fault.value(format!("{without} of {}", frames.len())).remedy("these pairs are not evaluated"));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let table = below.join("cam0/data.csv").to_string_lossy().into_owned();
    let body_from_camera = left.body_from_sensor;
    Ok(Foreign { folder: folder.to_owned(), rig, body_from_camera, frames, table, warnings }.into())
}

/// A camera with its pose in the body.
struct Sensor<F> {
    camera: Pinhole,
    body_from_sensor: Transform<Body, F>,
}

fn camera(folder: &Path) -> Result<Sensor<Camera>, Fault> {
    let yaml = Sheet::read(folder.join("sensor.yaml"))?;
    let size = yaml.numbers::<2>("resolution")?;
    let [fx, fy, cx, cy] = yaml.numbers::<4>("intrinsics")?;
    yaml.word("camera_model", &["pinhole"])?;
    yaml.word("distortion_model", &["radial-tangential", "radtan", "plumb_bob", "none", "equidistant"])?;
    let equidistant = yaml.content["distortion_model"].as_str() == Some("equidistant");
    let distortion = yaml.list("distortion_coefficients")?;
    let size = size.map(|length| length as u32);
    let new = if equidistant { Pinhole::equidistant } else { Pinhole::new };
    let camera =
        new(size, [fx, fy], [cx, cy], &distortion).map_err(|error| yaml.fault("intrinsics", error.to_string()))?;
    Ok(Sensor { camera, body_from_sensor: yaml.body_from_sensor()? })
}

/// The stamp, line and file of each image.
fn images(folder: &Path) -> Result<Vec<(u64, usize, String)>, Fault> {
    let file = folder.join("data.csv");
    let mut images: Vec<(u64, usize, String)> = Vec::new();
    for (index, line) in read_text(&file)?.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fault = |what: &str, remedy: &str| Fault::new(what, &file).on_line(index + 1).value(line).remedy(remedy);
        let Some((stamp, name)) = line.split_once(',').map(|(stamp, name)| (stamp.trim(), name.trim())) else {
            return Err(fault("a line without a file", "a line is `nanoseconds,file`"));
        };
        let stamp = stamp.parse().map_err(|_| fault("an invalid stamp", "give whole nanoseconds"))?;
        if images.last().is_some_and(|(last, ..)| *last >= stamp) {
            return Err(fault("a stamp not later than the previous one", "sort the lines by time"));
        }
        images.push((stamp, index + 1, name.to_owned()));
    }
    if images.is_empty() {
        return Err(Fault::new("no image", &file).remedy("give one line an image: nanoseconds,file"));
    }
    Ok(images)
}

/// The true poses of the left camera; empty without truth.
fn truth(home: &Path, body_from_camera: &Transform<Body, Camera>) -> Result<Vec<Stamped<World, Camera>>, Fault> {
    /// The sensor whose pose the truth is.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Marker;
    impl Frame for Marker {}

    let folder = home.join(TRUTH);
    if !folder.join("data.csv").exists() {
        return Ok(Vec::new());
    }
    let sheet = folder.join("sensor.yaml");
    let body_from_marker: Transform<Body, Marker> =
        if sheet.exists() { Sheet::read(sheet)?.body_from_sensor()? } else { Transform::identity() };
    let marker_from_camera = body_from_marker.inverse() * *body_from_camera;
    let read = Trajectory::read(&folder.join("data.csv"))?;
    if !read.has_attitude {
        let fault = Fault::new("a truth without an attitude", &folder.join("data.csv"));
        return Err(fault.remedy("give poses: nanoseconds, px, py, pz, qw, qx, qy, qz"));
    }
    let poses = read.poses.iter().map(|pose| {
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(pose.rotation);
        let mut turn = UnitQuaternion::from_rotation_matrix(&rotation);
        turn.renormalize();
        Transform::<World, Marker>::new(turn, pose.position) * marker_from_camera
    });
    Ok(read.stamps.unwrap_or_default().into_iter().zip(poses).collect())
}

/// A `sensor.yaml` file.
struct Sheet {
    file: PathBuf,
    text: String,
    content: Yaml,
}

impl Sheet {
    fn read(file: PathBuf) -> Result<Self, Fault> {
        let text = read_text(&file)?;
        let content = yaml::parse(&text, &file)?;
        Ok(Self { file, content, text })
    }

    /// The fault of `key`, with its line.
    fn fault(&self, key: &str, what: impl Into<String>) -> Fault {
        let line = self.text.lines().position(|line| line.trim_start().starts_with(key)).map(|index| index + 1);
        Fault::new(what, &self.file).on_line(line)
    }

    fn list(&self, key: &str) -> Result<Vec<f64>, Fault> {
        self.numbers_of(key, &self.content[key])
    }

    fn numbers_of(&self, key: &str, value: &Yaml) -> Result<Vec<f64>, Fault> {
        let number = |value: &Yaml| value.as_f64().or_else(|| value.as_i64().map(|integer| integer as f64));
        let numbers = value.as_vec().and_then(|list| list.iter().map(number).collect::<Option<Vec<f64>>>());
        numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())).ok_or_else(|| {
            self.fault(key, format!("`{key}` is not a list of numbers")).remedy("give a sensor.yaml of EuRoC")
        })
    }

    fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], Fault> {
        let numbers = self.list(key)?;
        let count = numbers.len();
        numbers
            .try_into()
            .map_err(|_| self.fault(key, format!("`{key}` has {count} numbers")).remedy(format!("give {N}")))
    }

    /// The value of a key with a fixed set of words.
    fn word(&self, key: &str, known: &[&str]) -> Result<(), Fault> {
        match self.content[key].as_str() {
            Some(word) if known.contains(&word) => Ok(()),
            other => Err(self
                .fault(key, format!("an unknown `{key}`"))
                .value(other.unwrap_or_default())
                .remedy(format!("give {}", known.join(", ")))),
        }
    }

    fn body_from_sensor<F: Frame>(&self) -> Result<Transform<Body, F>, Fault> {
        let numbers = self.numbers_of("T_BS", &self.content["T_BS"]["data"])?;
        let (rows, rest) = numbers.as_chunks::<4>();
        let rows: [[f64; 4]; 4] = rows
            .try_into()
            .ok()
            .filter(|_| rest.is_empty())
            .ok_or_else(|| self.fault("T_BS", format!("`T_BS` has {} numbers", numbers.len())).remedy("give 16"))?;
        Transform::from_rows(&rows).map_err(|error| self.fault("T_BS", error.to_string()))
    }
}
