//! Common parts of foreign data set formats.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, StereoRig, Transform};

use seafix_io::ImageLimits;

use super::{
    contents::{Dataset, DatasetFrame},
    folder::{inside, is_absent},
};
use crate::sensor_buffer::SensorBuffer;

/// A data set in a foreign format, without site and prior.
pub(super) struct Foreign {
    pub(super) folder: PathBuf,
    pub(super) rig: StereoRig,
    pub(super) body_from_camera: Transform<Body, Camera>,
    pub(super) frames: Vec<DatasetFrame>,
    /// The file that lists the frames, relative to the folder.
    pub(super) table: String,
    pub(super) warnings: Vec<Fault>,
}

impl From<Foreign> for Dataset {
    fn from(foreign: Foreign) -> Self {
        let Foreign { folder, rig, body_from_camera, frames, table, warnings } = foreign;
        // The canonical path has a name even for `.`.
        let real = folder.canonicalize().unwrap_or_else(|_| folder.clone());
        Self {
            name: real.file_name().map_or_else(|| "dataset".to_owned(), |name| name.to_string_lossy().into_owned()),
            folder,
            rig,
            ports: [None, None],
            site: None,
            body_from_camera,
            frames,
            objects: Vec::new(),
            has_visibility: false,
            sensor_buffer: SensorBuffer::default(),
            bits: 16,
            limits: ImageLimits::default(),
            table,
            hashes: Vec::new(),
            warnings,
        }
    }
}

/// The image `name` of `folder`, listed in `table`. A missing file is a fault unless `pairs_only`.
pub(super) fn image(folder: &Path, name: &str, table: &Path, pairs_only: bool) -> Result<PathBuf, Fault> {
    if pairs_only && is_absent(folder, name) { Ok(folder.join(name)) } else { inside(folder, name, table) }
}
