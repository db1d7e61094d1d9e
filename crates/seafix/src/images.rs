//! Stereo pairs from image files.

use std::path::Path;

use seafix_geometry::StereoRig;
use seafix_io::{ImageLimits, Rig, read_image};
use seafix_vision::Image;

use crate::{error::Error, sensor_frame::FrameData};

/// A stereo pair: the left and the right image of one instant.
#[derive(Debug, Clone)]
pub struct StereoImages {
    /// The left image.
    pub left: Image,
    /// The right image.
    pub right: Image,
}

impl StereoImages {
    /// Reads the two image files of a pair (PNG, JPEG, TIFF or PNM, grey or colour).
    ///
    /// # Errors
    /// [`Error::File`]: a file that cannot be read or decoded, or an image of another size than its camera's calibration.
    pub fn open(left: impl AsRef<Path>, right: impl AsRef<Path>, rig: &Rig) -> Result<Self, Error> {
        let read = |path: &Path, size| read_image(path, size, rig.bits, ImageLimits::default());
        let left = read(left.as_ref(), rig.stereo.left().size())?;
        Ok(Self { left, right: read(right.as_ref(), rig.stereo.right().size())? })
    }

    /// The pair as the measurements of a [`SensorFrame`](crate::SensorFrame).
    pub fn into_frame_data(self) -> FrameData {
        FrameData::Stereo(self.left, self.right)
    }
}

/// Checks that each image has the size that its camera is calibrated for.
pub(crate) fn check_sizes(left: &Image, right: &Image, rig: &StereoRig) -> Result<(), Error> {
    for (side, image, camera) in [("left", left, rig.left()), ("right", right, rig.right())] {
        let [expected_width, expected_height] = camera.size();
        let (width, height) = (image.width(), image.height());
        if [width, height] != [expected_width as usize, expected_height as usize] {
            return Err(Error::ImageSize { side, width, height, expected_width, expected_height });
        }
    }
    Ok(())
}
