//! The contents of a data set.

use std::path::PathBuf;

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Covariance6, Object, StereoRig, Transform, World};
use seafix_io::{ImageLimits, image::size_fault, read_image};
use seafix_navigation::Reading;
use seafix_referencing::Site;
use seafix_vision::Image;

use crate::{ports::CalibratedPort, sensor_buffer::SensorBuffer};

/// A data set with valid description, tables and paths. Its images are read frame by frame.
#[derive(Debug)]
pub struct Dataset {
    /// The name.
    pub name: String,
    /// The folder.
    pub folder: PathBuf,
    /// The stereo rig.
    pub rig: StereoRig,
    /// The ports in front of the cameras; the rig was calibrated in water behind them.
    pub ports: [Option<CalibratedPort>; 2],
    /// The site, if known.
    pub site: Option<Site>,
    /// The pose of the left camera in the vehicle; the identity if the description has none.
    pub body_from_camera: Transform<Body, Camera>,
    /// The stereo pairs, in order of time.
    pub frames: Vec<DatasetFrame>,
    /// The true poses of displaced objects by id; the others are as surveyed.
    pub objects: Vec<(String, Transform<World, Object>)>,
    /// Whether the data set lists the visible feature points.
    pub has_visibility: bool,
    /// The readings of its Doppler log and gyro.
    pub sensor_buffer: SensorBuffer,
    /// The number of significant bits of a pixel in images of 16 bits.
    pub bits: u8,
    /// The limits of image sizes, set by the reader rather than the data set.
    pub limits: ImageLimits,
    /// The table of the frames, relative to the folder.
    pub(super) table: String,
    pub(super) hashes: Vec<(String, String)>,
    /// The warnings.
    pub warnings: Vec<Fault>,
}

/// A stereo pair of a data set with its truth and its prior.
#[derive(Debug, Clone)]
pub struct DatasetFrame {
    /// The time (ns).
    pub stamp_ns: u64,
    /// The file of the left image.
    pub left: PathBuf,
    /// The file of the right image.
    pub right: PathBuf,
    /// The ground truth pose of the left camera.
    pub truth: Option<Transform<World, Camera>>,
    /// The prior pose with its covariance.
    pub prior: Option<(Transform<World, Camera>, Covariance6<World, Camera>)>,
    /// The feature points in view of both cameras: (object, point).
    pub visible: Vec<(String, String)>,
}

impl Dataset {
    /// The same data set with other limits for its images.
    #[must_use]
    pub fn within(self, limits: ImageLimits) -> Self {
        Self { limits, ..self }
    }

    /// Whether there are readings of both the Doppler log and the gyro.
    pub fn has_readings(&self) -> bool {
        self.sensor_buffer.is_complete()
    }

    /// The readings of Doppler log and gyro after `before` and up to `now` (ns).
    pub fn readings(&self, before: Option<u64>, now: u64) -> Vec<Reading> {
        self.sensor_buffer.between(before, now)
    }

    /// The two images of `frame`.
    ///
    /// # Errors
    /// As for [`read_image`].
    pub fn pair(&self, frame: &DatasetFrame) -> Result<(Image, Image), Fault> {
        let left = read_image(&frame.left, self.rig.left().size(), self.bits, self.limits)?;
        Ok((left, read_image(&frame.right, self.rig.right().size(), self.bits, self.limits)?))
    }

    /// Skips, with a warning, the pairs with an image of another size than its camera's calibration; a data set
    /// recorded in two modes has some. If these are more than half of the pairs, none is skipped: the calibration is
    /// wrong then, and the fault occurs when the images are read.
    pub fn leave_out_mismatches(&mut self) {
        let sizes = [self.rig.left().size(), self.rig.right().size()];
        let faults: Vec<Option<Fault>> = self
            .frames
            .iter()
            .map(|frame| {
                [&frame.left, &frame.right].into_iter().zip(sizes).find_map(|(path, size)| size_fault(path, size))
            })
            .collect();
        let (all, mismatches) = (faults.len(), faults.iter().flatten().count());
        let Some(first) = faults.iter().flatten().next().filter(|_| 2 * mismatches <= all) else { return };
        self.warnings.push(Fault {
            what: format!("{mismatches} of {all} pairs skipped: {}", first.what),
            remedy: "`reject-mismatched-images = true` of the source rejects the data set".to_owned(),
            ..first.clone()
        });
        let mut fits = faults.iter().map(Option::is_none);
        self.frames.retain(|_| fits.next().unwrap_or(true));
    }
}
