//! KITTI odometry sequences.

use std::path::Path;

use seafix_component::{Component, Fault, Settings, in_range};
use seafix_io::ImageLimits;
use serde::{Deserialize, Serialize};

use super::dataset::{DatasetSource, Recorded};
use crate::{
    dataset::{Cameras, Dataset},
    sequence::{Sequence, Source},
};

/// A reader of KITTI odometry sequences: `calib.txt`, `times.txt`, `image_0`, `image_1`, and the ground truth in
/// `poses.txt` or `../../poses/NAME.txt`.
#[derive(Debug, Clone, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Kitti {
    /// The folder, relative to the experiment file.
    pub path: String,
    /// The site file, relative to the experiment file.
    pub site: String,
    /// The pair of cameras: `grey`, `colour`, or `any` (grey if present).
    pub cameras: Cameras,
    /// The maximum number of pixels in an image's header.
    pub max_pixels: u64,
    /// The maximum size of an image file and of its decoder's memory (bytes).
    pub max_bytes: u64,
}

impl Default for Kitti {
    fn default() -> Self {
        let DatasetSource { path, site, max_pixels, max_bytes, .. } = DatasetSource::default();
        Self { path, site, cameras: Cameras::Any, max_pixels, max_bytes }
    }
}

impl Component for Kitti {
    const NAME: &'static str = "kitti";
    const SUMMARY: &'static str = "stereo pairs from an odometry sequence of KITTI, with a site of your own";
    const SOURCE: &'static str = "Geiger, Lenz and Urtasun, Are we ready for autonomous driving?, 2012";

    fn check(&self) -> Result<(), String> {
        in_range(!self.site.is_empty(), "site", "''", "the file of a site, relative to the experiment file")?;
        let (path, site) = (self.path.clone(), self.site.clone());
        DatasetSource {
            path,
            site,
            max_pixels: self.max_pixels,
            max_bytes: self.max_bytes,
            reject_mismatched_images: true,
            sort_stamps: false,
        }
        .check()
    }
}

impl Source for Kitti {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let limits = ImageLimits { pixels: self.max_pixels, bytes: self.max_bytes };
        let dataset = Dataset::open_kitti(&folder.join(&self.path), self.cameras)?;
        Recorded::open(dataset.within(limits), &self.site, folder)
    }
}
