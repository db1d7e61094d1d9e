//! The images of one frame in the form of logs, encoded once for all trials.

use seafix_log::{GreyImage, encode_png};

use seafix::FrameData;
use seafix_data::{dataset::grey, log_conversion};

use crate::logging::ImagesLogged;

/// The images of a frame at one level of logging.
#[derive(Debug)]
pub(crate) struct Pictures {
    level: ImagesLogged,
    /// Left and right, if there are images and they are logged.
    pub(crate) grey: Option<[GreyImage; 2]>,
    /// Whether they equal the images that the pipeline received.
    pub(crate) are_exact: bool,
    /// The same images as PNG.
    pub(crate) pngs: Option<[Vec<u8>; 2]>,
}

impl Pictures {
    fn new(frame_data: &FrameData, level: ImagesLogged) -> Self {
        let grey = match frame_data {
            FrameData::Stereo(left, right) => {
                level.logged(grey(left)).zip(level.logged(grey(right))).map(<[_; 2]>::from)
            }
            FrameData::Points(_) | FrameData::Features(..) => None,
        };
        let are_exact = level == ImagesLogged::All && log_conversion::is_exact(frame_data);
        // An image that cannot be compressed is reported by the writer of the log.
        let pngs = grey.as_ref().and_then(|[left, right]| Some([encode_png(left).ok()?, encode_png(right).ok()?]));
        Self { level, grey, are_exact, pngs }
    }
}

/// The images of a frame at every level that some trial logs.
#[derive(Debug, Default)]
pub(crate) struct Levels(Vec<Pictures>);

impl Levels {
    /// The images at one level, created at the first request.
    pub(crate) fn at(&mut self, level: ImagesLogged, frame_data: &FrameData) -> &Pictures {
        let known = self.0.iter().position(|pictures| pictures.level == level);
        let place = known.unwrap_or_else(|| {
            self.0.push(Pictures::new(frame_data, level));
            self.0.len() - 1
        });
        &self.0[place]
    }

    /// The images of a level as PNG, if they were requested.
    pub(crate) fn pngs(&self, level: ImagesLogged) -> Option<&[Vec<u8>; 2]> {
        self.0.iter().find(|pictures| pictures.level == level)?.pngs.as_ref()
    }
}
