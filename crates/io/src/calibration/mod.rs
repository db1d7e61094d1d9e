//! Stereo calibrations as other programs write them, one format a file.
//!
//! Every reader gives the numbers of a [`RigNumbers`]; a pixel's centre has whole coordinates, lengths are in metres.

mod camera_info;
mod colmap;
mod colmap_rig;
mod common_view;
mod euroc;
mod found;
mod kalibr;
mod kitti;
mod matlab;
mod metashape;
mod opencv;
mod opencv_xml;
mod orb_slam;
mod text;

use std::path::{Path, PathBuf};

use seafix_component::{Fault, read_text};
use seafix_geometry::StereoRig;

use crate::dataset::RigNumbers;
use found::Found;
pub use found::Given;
use text::Source;

/// A stereo calibration with its origin.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The numbers, as a data set description holds them.
    pub numbers: RigNumbers,
    /// The rig.
    pub rig: StereoRig,
    /// The name of the file's format.
    pub format: &'static str,
    /// What the file left open and how it was taken.
    pub notes: Vec<String>,
    /// A warning of cameras that are rotated against each other.
    pub warning: Option<Fault>,
}

/// Reads the calibration in `files`: one file, or one a camera (left, right), or intrinsics and extrinsics.
///
/// A partner that stands beside the first file under its usual name need not be named.
///
/// # Errors
/// A file that cannot be read, has an unknown format, or an invalid number; a missing partner; cameras without a common
/// view.
pub fn read(files: &[PathBuf], given: Given) -> Result<Calibration, Fault> {
    let mut sources = files.iter().map(|file| Source::read(file)).collect::<Result<Vec<_>, Fault>>()?;
    let first = sources[0].file.clone();
    if sources.len() == 1
        && let Some(partner) = partner(&first)
    {
        sources.push(Source::read(&partner)?);
    }
    let readers = [
        kalibr::read,
        camera_info::read,
        euroc::read,
        orb_slam::read,
        matlab::read,
        colmap_rig::read,
        opencv::read,
        colmap::read,
        metashape::read,
        kitti::read,
    ];
    for reader in readers {
        if let Some(found) = reader(&sources, given)? {
            return checked(found, &first);
        }
    }
    let fault = Fault::new("not a known stereo calibration", &first);
    Err(fault.remedy(
        "give dataset.toml, Kalibr's camchain, ROS's left.yaml and right.yaml, OpenCV's yml, xml or json, EuRoC's \
         sensor.yaml, COLMAP's cameras.txt and rigs.txt, or rig_config.json, settings of ORB-SLAM, Metashape's xml, MATLAB's Calib_Results_stereo.m or json, or KITTI's calib.txt",
    ))
}

/// The file that usually stands beside `file` and completes it.
fn partner(file: &Path) -> Option<PathBuf> {
    let name = file.file_name()?.to_str()?;
    let pairs = [
        ("left", "right"),
        ("Left", "Right"),
        ("LEFT", "RIGHT"),
        ("cam0", "cam1"),
        ("camera0", "camera1"),
        ("intrinsics", "extrinsics"),
        ("cameras.txt", "rigs.txt"),
        ("rigs.txt", "cameras.txt"),
    ];
    let beside = pairs
        .iter()
        .filter(|(from, _)| name.contains(from))
        .map(|(from, to)| file.with_file_name(name.replacen(from, to, 1)));
    // EuRoC has one folder a camera.
    let folder = file.parent()?;
    let other = folder.file_name().is_some_and(|name| name == "cam0").then(|| folder.with_file_name("cam1").join(name));
    beside.chain(other).find(|partner| partner.is_file())
}

fn checked(found: Found, file: &Path) -> Result<Calibration, Fault> {
    let Found { numbers, format, mut notes } = found;
    let invalid = |(path, message): (Vec<&'static str>, String)| {
        let (what, remedy) = message.split_once("; ").unwrap_or((&message, "correct the calibration"));
        Fault::new(what, file).value(path.join(".")).remedy(remedy)
    };
    let rig = numbers.build().map_err(invalid)?;
    // The centre of the left camera in the right camera's frame; a positive x puts the right camera on the left.
    let step = rig.right_from_left().translation();
    if step.x > 0.5 * step.norm() {
        notes.push(
            "the right camera is to the left of the left one: exchange the files unless this is intended".to_owned(),
        );
    }
    let warning = common_view::check(&rig, file)?;
    Ok(Calibration { numbers, rig, format, notes, warning })
}

/// Whether the text of `file` is that of a data set description or of another file of this program.
pub fn is_foreign(file: &Path) -> bool {
    file.extension().is_some_and(|end| ["yaml", "yml", "xml", "txt", "m", "json"].iter().any(|known| end == *known))
}

/// Whether `file` can be read as a calibration; its name alone does not tell.
pub fn is_calibration(file: &Path) -> bool {
    is_foreign(file)
        && read_text(file).is_ok_and(|text| {
            // COLMAP's images name their cameras too.
            if text.contains("IMAGE_ID") {
                return false;
            }
            colmap::is_cameras(&text)
                || colmap_rig::is_one(&text)
                || opencv::is_json(file, &text)
                || [
                    "cam0",
                    kalibr::REPORT,
                    "camera_matrix",
                    "opencv_storage",
                    "%YAML",
                    "camera_model",
                    "distortion_model",
                    "<calibration",
                    "<sensors",
                    "CAMERA_ID",
                    "fc_left",
                    "RotationOfCamera2",
                    "PoseCamera2",
                    "P_rect_00",
                    "P0:",
                    "Camera.fx",
                    "Camera1.fx",
                ]
                .iter()
                .any(|word| text.contains(word))
        })
}

#[cfg(test)]
mod tests;
