//! EuRoC data sets.

use std::path::Path;

use seafix_component::{Component, Fault, Settings, in_range};
use seafix_io::ImageLimits;
use serde::{Deserialize, Serialize};

use super::dataset::{DatasetSource, Recorded};
use crate::{
    dataset::Dataset,
    sequence::{Sequence, Source},
};

/// A reader of folders in the EuRoC layout: `mav0/cam0`, `mav0/cam1`, `mav0/state_groundtruth_estimate0`.
#[derive(Debug, Clone, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Euroc {
    /// The folder, relative to the experiment file.
    pub path: String,
    /// The site file, relative to the experiment file.
    pub site: String,
    /// The maximum number of pixels in an image's header.
    pub max_pixels: u64,
    /// The maximum size of an image file and of its decoder's memory (bytes).
    pub max_bytes: u64,
}

impl Default for Euroc {
    fn default() -> Self {
        let DatasetSource { path, site, max_pixels, max_bytes, .. } = DatasetSource::default();
        Self { path, site, max_pixels, max_bytes }
    }
}

impl Component for Euroc {
    const NAME: &'static str = "euroc";
    const SUMMARY: &'static str = "stereo pairs from a folder in the layout of EuRoC (ASL), with a site of your own";
    const SOURCE: &'static str = "Burri et al., The EuRoC micro aerial vehicle datasets, 2016";

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

impl Source for Euroc {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let limits = ImageLimits { pixels: self.max_pixels, bytes: self.max_bytes };
        let dataset = Dataset::open_euroc(&folder.join(&self.path))?;
        Recorded::open(dataset.within(limits), &self.site, folder)
    }
}
