//! Stereo rigs from files.

use std::path::{Path, PathBuf};

use seafix_component::{Fault, read_text};
use seafix_geometry::{Body, Camera, StereoRig, Transform};

use crate::{
    calibration::{self, Given},
    dataset::Description,
};

/// A stereo rig with its pose in the vehicle and the bit depth of its images.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The two cameras.
    pub stereo: StereoRig,
    /// The pose of the left camera in the vehicle; the identity if the file has none.
    pub body_from_camera: Transform<Body, Camera>,
    /// The number of significant bits of a pixel in image files of 16 bits.
    pub bits: u8,
    /// The source file; `None` for a rig built in code.
    pub file: Option<PathBuf>,
    /// A warning if the file marks the rig as rectified and the cameras contradict it, or if they are rotated against each
    /// other.
    pub warning: Option<Fault>,
}

impl Rig {
    /// Reads the `[rig]` table of a data set description (`seafix-dataset/1`), the file or its folder, or the stereo
    /// calibration of another program ([`calibration`](crate::calibration)).
    ///
    /// # Errors
    /// A file that cannot be read, or its first invalid value.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, Fault> {
        let path = path.as_ref();
        let file = if path.is_dir() { path.join("dataset.toml") } else { path.to_owned() };
        if calibration::is_foreign(&file) {
            let found = calibration::read(std::slice::from_ref(&file), Given::default())?;
            return Ok(Self { file: Some(file), warning: found.warning, ..Self::from(found.rig) });
        }
        let source = read_text(&file)?;
        let description: Description =
            toml::from_str(&source).map_err(|error| Fault::in_toml(&file, &source, &error))?;
        let stereo = description.build_rig(&file, &source)?;
        Ok(Self {
            body_from_camera: description.mounting(&file, &source)?,
            bits: description.depth(&file, &source)?,
            warning: description.not_rectified(&stereo, &file, &source),
            stereo,
            file: Some(file),
        })
    }
}

impl From<StereoRig> for Rig {
    /// A rig without mounting: the left camera is the vehicle's frame. Images have up to 16 bits.
    fn from(stereo: StereoRig) -> Self {
        Self { stereo, body_from_camera: Transform::identity(), bits: 16, file: None, warning: None }
    }
}
