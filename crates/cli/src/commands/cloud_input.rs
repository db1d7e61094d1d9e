//! The stereo pair of `seafix cloud`.

use std::path::{Path, PathBuf};

use clap::Args;
use seafix::Rig;
use seafix_component::Fault;
use seafix_data::dataset::{are_identical, identical_images_fault};
use seafix_geometry::StereoRig;
use seafix_io::read_image;
use seafix_vision::Image;

use super::{limits::Limits, pair_source::PairSource};
use crate::exit::{Failure, INPUT, USAGE};

/// Two images with a rig, or one pair of a data set, a recording or a log.
#[derive(Debug, Args)]
pub(crate) struct CloudInput {
    /// The left image; or a data set, a recording of ROS 2 (an MCAP file or a folder of rosbag2) or the log of a trial
    /// with its images, which has both images and the rig.
    left: PathBuf,
    /// The right image.
    #[arg(requires = "rig")]
    right: Option<PathBuf>,
    /// The stereo rig of two images: a dataset.toml, of which only the rig and `bits` are read.
    #[arg(long, value_name = "DATASET.toml", requires = "right")]
    rig: Option<PathBuf>,
    /// The stereo pair of a data set, a recording or a log, counted from 0.
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "right")]
    pair: usize,
    #[command(flatten)]
    pair_source: PairSource,
    #[command(flatten)]
    limits: Limits,
}

/// A stereo pair with its rig.
pub(crate) struct CloudPair {
    pub(crate) images: [Image; 2],
    /// The names of the images in messages: their files, or the file that holds them with the time.
    pub(crate) names: [PathBuf; 2],
    pub(crate) rig: StereoRig,
    /// The file with the rig.
    pub(crate) rig_file: PathBuf,
    pub(crate) warnings: Vec<Fault>,
}

impl CloudInput {
    /// The files that an output must not replace.
    pub(crate) fn files(&self) -> Vec<&Path> {
        [Some(&self.left), self.right.as_ref(), self.rig.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect()
    }

    /// Reads the pair.
    pub(crate) fn read(&self) -> Result<CloudPair, Failure> {
        match (&self.right, &self.rig) {
            (Some(right), Some(rig)) => self.of_images(right, rig),
            _ => self.of_pairs(),
        }
    }

    fn of_images(&self, right: &Path, rig: &Path) -> Result<CloudPair, Failure> {
        let input = |fault: Fault| Failure::new(INPUT, fault);
        self.pair_source.of_no_recording()?;
        let Rig { stereo: rig, bits, file, warning, .. } = Rig::from_file(rig).map_err(input)?;
        let limits = self.limits.of_images();
        let images = [
            read_image(&self.left, rig.left().size(), bits, limits).map_err(input)?,
            read_image(right, rig.right().size(), bits, limits).map_err(input)?,
        ];
        if are_identical(&images[0], &images[1]) {
            return Err(input(identical_images_fault(&self.left, right)));
        }
        let names = [self.left.clone(), right.to_owned()];
        Ok(CloudPair {
            images,
            names,
            rig,
            rig_file: file.unwrap_or_default(),
            warnings: warning.into_iter().collect(),
        })
    }

    fn of_pairs(&self) -> Result<CloudPair, Failure> {
        let input = |fault: Fault| Failure::new(INPUT, fault);
        if self.left.is_file() && self.left.extension().is_none_or(|end| end != "mcap") {
            let fault = Fault::new("one image without the other", &self.left);
            let remedy = "give LEFT RIGHT --rig DATASET.toml, or a data set, a recording (.mcap) or a log";
            return Err(Failure::new(USAGE, fault.remedy(remedy)));
        }
        let pairs = self.pair_source.open(&self.left, false, self.limits.of_images())?;
        let count = pairs.stamps().len();
        if self.pair >= count {
            let fault = Fault::new("no such stereo pair", &self.left).value(self.pair.to_string());
            return Err(Failure::new(USAGE, fault.remedy(format!("--pair is from 0 to {}", count.saturating_sub(1)))));
        }
        let (left, right) = pairs.pair(self.pair).map_err(input)?;
        Ok(CloudPair {
            images: [left, right],
            names: pairs.names(self.pair),
            rig: pairs.rig,
            rig_file: pairs.path().to_owned(),
            warnings: pairs.warnings,
        })
    }
}
