//! KITTI odometry sequences: `calib.txt`, `times.txt`, `image_0` and `image_1` (grey) or `image_2` and `image_3`
//! (colour), and the truth in `poses.txt` or, as in the benchmark, `../../poses/NAME.txt`.
//!
//! The projection matrices are `Pi = K [I | t]`: rectified cameras, shifted by t from camera 0. A line of the truth is
//! the pose of camera 0 in the world.

use std::path::{Path, PathBuf};

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Settings;
use seafix_component::{Fault, read_text};
use seafix_geometry::{Camera, Pinhole, StereoRig, Transform, World};
use serde::{Deserialize, Serialize};

use seafix_io::image::declared_size;

use super::{
    contents::{Dataset, DatasetFrame},
    foreign::{Foreign, image},
};
use crate::{formats::stamp::nanoseconds, trajectory::Trajectory};

/// The pair of cameras to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Cameras {
    /// The grey cameras if present, otherwise the colour ones.
    #[default]
    Any,
    /// The grey cameras `image_0` and `image_1`.
    Grey,
    /// The colour cameras `image_2` and `image_3`.
    Colour,
}

impl Cameras {
    fn of(self, folder: &Path) -> [usize; 2] {
        match self {
            Self::Grey => [0, 1],
            Self::Any if folder.join("image_0").is_dir() => [0, 1],
            Self::Any | Self::Colour => [2, 3],
        }
    }
}

/// Whether `folder` is a KITTI sequence.
pub(super) fn is_one(folder: &Path) -> bool {
    folder.join("calib.txt").is_file() && [0, 2].iter().any(|k| folder.join(format!("image_{k}")).is_dir())
}

/// Reads the sequence in `folder`.
pub(super) fn read(folder: &Path, cameras: Cameras, pairs_only: bool) -> Result<Dataset, Vec<Fault>> {
    let cameras = cameras.of(folder);
    let stamps = times(folder).map_err(|fault| vec![fault])?;
    begins_with_zero(folder, cameras[0]).map_err(|fault| vec![fault])?;
    let unstamped = without_stamps(folder, cameras, stamps.len()).map_err(|fault| vec![fault])?;
    let (mut faults, mut frames) = (Vec::new(), Vec::with_capacity(stamps.len()));
    let table = folder.join("times.txt");
    for (index, stamp_ns) in stamps.iter().copied().enumerate() {
        let mut place = |camera: usize| {
            let found = image(folder, &format!("image_{camera}/{index:06}.png"), &table, pairs_only);
            found.map_err(|fault| faults.push(fault.on_line(index + 1))).ok()
        };
        let (Some(left), Some(right)) = (place(cameras[0]), place(cameras[1])) else { continue };
        frames.push(DatasetFrame { stamp_ns, left, right, truth: None, prior: None, visible: Vec::new() });
    }
    let Some(size) = frames.first().and_then(|frame| declared_size(&frame.left)) else {
        let fault = Fault::new("no image that gives the cameras' size", &folder.join(format!("image_{}", cameras[0])));
        return Err(faults.into_iter().chain([fault.remedy("name the images 000000.png, …")]).collect());
    };
    let (rig, shift) = rig(folder, cameras, size).map_err(|fault| vec![fault])?;
    if !pairs_only && faults.is_empty() {
        match truth(folder, stamps.len()) {
            Ok(poses) => {
                // A point at x in the left camera is at x − t in camera 0.
                let zero_from_left = Transform::<Camera, Camera>::new(UnitQuaternion::identity(), -shift);
                for (frame, pose) in frames.iter_mut().zip(poses) {
                    frame.truth = Some(pose * zero_from_left);
                }
            }
            Err(fault) => faults.push(fault),
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let table = "times.txt".to_owned();
    let body_from_camera = Transform::identity();
    Ok(Foreign {
        folder: folder.to_owned(),
        rig,
        body_from_camera,
        frames,
        table,
        warnings: unstamped.into_iter().collect(),
    }
    .into())
}

/// The fault of images whose numbers begin above zero: line 1 of the stamps and of the truth belongs to image 0.
fn begins_with_zero(folder: &Path, camera: usize) -> Result<(), Fault> {
    let images = folder.join(format!("image_{camera}"));
    let name = |entry: std::io::Result<std::fs::DirEntry>| entry.ok()?.file_name().into_string().ok();
    let number = |name: &String| name.strip_suffix(".png")?.parse::<u32>().ok();
    let all = std::fs::read_dir(&images).into_iter().flatten().filter_map(name);
    match all.filter_map(|name| Some((number(&name)?, name))).min() {
        Some((first, name)) if first > 0 => Err(Fault::new("images that do not begin with 000000.png", &images)
            .value(format!("the first is {name}"))
            .remedy("line 1 of times.txt and poses.txt belongs to 000000.png: rename the images")),
        _ => Ok(()),
    }
}

/// The images beyond the last stamp: a warning, or a fault if they are more than half.
fn without_stamps(folder: &Path, cameras: [usize; 2], stamps: usize) -> Result<Option<Fault>, Fault> {
    let count = |camera: usize| {
        let entries = std::fs::read_dir(folder.join(format!("image_{camera}"))).into_iter().flatten();
        entries.filter_map(Result::ok).filter(|entry| entry.path().extension().is_some_and(|end| end == "png")).count()
    };
    let [left, right] = cameras.map(count);
    let images = left.max(right);
    let fault = Fault::new("images without a stamp", &folder.join("times.txt"))
        .value(format!("{stamps} stamps, {left} left and {right} right images"));
    match () {
        () if images <= stamps => Ok(None),
        () if images > 2 * stamps => {
            Err(fault.remedy("give one line a stereo pair (seconds); at least half of the images need one"))
        }
        () => Ok(Some(fault.remedy("give one line a stereo pair; images beyond the last line are skipped"))),
    }
}

/// The stamps (ns).
fn times(folder: &Path) -> Result<Vec<u64>, Fault> {
    let file = folder.join("times.txt");
    let mut stamps: Vec<u64> = Vec::new();
    for (index, line) in read_text(&file)?.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let fault = |what: &str, remedy: &str| Fault::new(what, &file).on_line(index + 1).value(line).remedy(remedy);
        let stamp = nanoseconds(line.trim()).ok_or_else(|| fault("an invalid stamp", "give seconds"))?;
        if stamps.last().is_some_and(|last| *last >= stamp) {
            return Err(fault("a stamp not later than the previous one", "sort the lines by time"));
        }
        stamps.push(stamp);
    }
    if stamps.is_empty() {
        return Err(Fault::new("no stamp", &file).remedy("give one line a stereo pair: seconds"));
    }
    Ok(stamps)
}

/// The rig, and the pose of camera 0 in the left camera's frame.
fn rig(folder: &Path, cameras: [usize; 2], size: [u32; 2]) -> Result<(StereoRig, Vector3<f64>), Fault> {
    let file = folder.join("calib.txt");
    let text = read_text(&file)?;
    let camera = |number: usize| {
        let name = format!("P{number}:");
        let Some((index, line)) = text.lines().enumerate().find(|(_, line)| line.trim_start().starts_with(&name))
        else {
            let fault = Fault::new(format!("no line `{name}`"), &file);
            return Err(fault.remedy("calib.txt of an odometry sequence has P0: to P3:, 12 numbers each"));
        };
        let fault = |what: String| Fault::new(what, &file).on_line(index + 1);
        let words: Vec<&str> = line.split_whitespace().skip(1).collect();
        let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
        let p: [f64; 12] = numbers
            .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
            .and_then(|numbers| numbers.try_into().ok())
            .ok_or_else(|| fault(format!("`{name}` without 12 finite numbers")).value(line))?;
        let [fx, skew, cx, tx, zero, fy, cy, ty, a, b, c, tz] = p;
        if [skew, zero, a, b] != [0.0; 4] || c != 1.0 {
            return Err(fault(format!("`{name}` is not of the form K [I | t]"))
                .value(line)
                .remedy("give rectified cameras"));
        }
        let pinhole = Pinhole::new(size, [fx, fy], [cx, cy], &[]).map_err(|error| fault(error.to_string()))?;
        Ok((pinhole, Vector3::new((tx - cx * tz) / fx, (ty - cy * tz) / fy, tz)))
    };
    let ((left, t_left), (right, t_right)) = (camera(cameras[0])?, camera(cameras[1])?);
    let right_from_left = Transform::new(UnitQuaternion::identity(), t_right - t_left);
    let rig = StereoRig::new(left, right, right_from_left).map_err(|error| Fault::new(error.to_string(), &file))?;
    Ok((rig, t_left))
}

/// The true poses of camera 0, one a frame; empty without truth.
fn truth(folder: &Path, frames: usize) -> Result<Vec<Transform<World, Camera>>, Fault> {
    let real = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = real.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let places: [PathBuf; 2] = [folder.join("poses.txt"), folder.join("../../poses").join(format!("{name}.txt"))];
    let Some(file) = places.iter().find(|file| file.is_file()) else { return Ok(Vec::new()) };
    let poses = Trajectory::read(file)?.poses;
    if poses.len() != frames {
        let fault =
            Fault::new("the numbers of poses and stamps differ", file).value(format!("{} of {frames}", poses.len()));
        return Err(fault.remedy("give one pose for each line of times.txt"));
    }
    let rigid = |pose: &seafix_evaluation::trajectory::Pose| {
        let mut rotation = nalgebra::Rotation3::from_matrix_unchecked(pose.rotation);
        rotation.renormalize();
        Transform::new(UnitQuaternion::from_rotation_matrix(&rotation), pose.position)
    };
    Ok(poses.iter().map(rigid).collect())
}
