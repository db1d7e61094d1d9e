//! Recorded data sets.

use std::path::Path;

use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_component::{Component, Fault, Settings, in_range, read_text};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_io::ImageLimits;
use seafix_referencing::Site;
use serde::{Deserialize, Serialize};

use crate::{
    dataset::{CalibratedPort, Dataset, contradictions, hash_faults, input_hashes, inspect_images, swapped},
    sequence::{Sequence, Source, Truth},
};

/// A reader of `seafix-dataset/1` folders, EuRoC folders and KITTI sequences.
#[derive(Debug, Clone, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DatasetSource {
    /// The folder, relative to the experiment file.
    pub path: String,
    /// The site file, relative to the experiment file; the data set's own site if empty.
    pub site: String,
    /// The maximum number of pixels in an image's header.
    pub max_pixels: u64,
    /// The maximum size of an image file and of its decoder's memory (bytes).
    pub max_bytes: u64,
    /// Whether an image of another size than the calibration rejects the data set. Otherwise its pair is skipped and
    /// counted; at least half of the pairs must remain.
    pub reject_mismatched_images: bool,
    /// Whether pairs are sorted by time, keeping the first of each stamp. Otherwise pairs out of order reject the data
    /// set.
    pub sort_stamps: bool,
}

impl Default for DatasetSource {
    fn default() -> Self {
        let ImageLimits { pixels, bytes } = ImageLimits::default();
        Self {
            path: String::new(),
            site: String::new(),
            max_pixels: pixels,
            max_bytes: bytes,
            reject_mismatched_images: false,
            sort_stamps: false,
        }
    }
}

impl Component for DatasetSource {
    const NAME: &'static str = "dataset";
    const SUMMARY: &'static str = "stereo pairs from the folder of a data set, Seafix, EuRoC or KITTI";
    const SOURCE: &'static str = "docs/formats.md";

    fn check(&self) -> Result<(), String> {
        in_range(!self.path.is_empty(), "path", "''", "the folder of a data set, relative to the experiment file")?;
        // The largest integer in TOML.
        let max = i64::MAX as u64;
        in_range((1..=max).contains(&self.max_pixels), "max-pixels", self.max_pixels, "at least 1")?;
        in_range((1..=max).contains(&self.max_bytes), "max-bytes", self.max_bytes, "at least 1")
    }
}

impl Source for DatasetSource {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let limits = ImageLimits { pixels: self.max_pixels, bytes: self.max_bytes };
        let path = folder.join(&self.path);
        let read = if self.sort_stamps { Dataset::open_repaired(&path) } else { Dataset::open(&path) };
        let mut dataset = read?.within(limits);
        if !self.reject_mismatched_images {
            dataset.leave_out_mismatches();
        }
        Recorded::open(dataset, &self.site, folder)
    }

    fn may_have_readings(&self) -> bool {
        true
    }
}

/// A data set with a site.
pub(super) struct Recorded {
    dataset: Dataset,
    site: Site,
}

impl Recorded {
    /// Opens the data set with its own site, or with the site file `site` relative to `folder`.
    pub(super) fn open(mut dataset: Dataset, site: &str, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        if !site.is_empty() {
            let file = folder.join(site);
            dataset.site = Some(Site::parse(&read_text(&file).map_err(|fault| vec![fault])?, &file)?);
        }
        let Some(site) = dataset.site.clone() else {
            let fault = Fault::new("no site", &dataset.folder);
            return Err(vec![fault.remedy("a fix needs a known object: add `site = \"site.toml\"`")]);
        };
        // Every image is decoded once before a run begins, so that a damaged one does not stop it midway.
        let (mut faults, identical) = inspect_images(&dataset);
        faults.extend(identical.fault(&dataset));
        faults.extend(hash_faults(&dataset));
        if faults.is_empty() {
            faults.extend(swapped(&dataset));
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        // A run goes on with data that contradict each other: its results show what they are worth.
        let doubts = contradictions(&dataset);
        dataset.warnings.extend(doubts);
        Ok(Box::new(Recorded { dataset, site }))
    }
}

impl Sequence for Recorded {
    fn name(&self) -> &str {
        &self.dataset.name
    }

    fn site(&self) -> &Site {
        &self.site
    }

    fn rig(&self) -> &StereoRig {
        &self.dataset.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.dataset.body_from_camera
    }

    fn images(&self) -> bool {
        true
    }

    fn bits(&self) -> u8 {
        // A data set without the key `bits` has 16; its images may have 8.
        if self.dataset.bits < 16 { self.dataset.bits } else { 8 }
    }

    fn has_readings(&self) -> bool {
        self.dataset.has_readings()
    }

    fn ports(&self) -> [Option<CalibratedPort>; 2] {
        self.dataset.ports.clone()
    }

    fn frames(&self) -> usize {
        self.dataset.frames.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let (_, covariance) = self.dataset.frames.iter().find_map(|frame| frame.prior)?;
        Some((covariance.position_sigma(), covariance.attitude_sigma()))
    }

    fn warnings(&self) -> &[Fault] {
        &self.dataset.warnings
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let frame = &self.dataset.frames[index];
        let (left, right) = self.dataset.pair(frame)?;
        let prior = frame.prior.map(|(world_from_camera, covariance)| PosePrior { world_from_camera, covariance });
        let before = index.checked_sub(1).map(|before| self.dataset.frames[before].stamp_ns);
        Ok(SensorFrame {
            stamp_ns: frame.stamp_ns,
            frame_data: FrameData::Stereo(left, right),
            prior,
            hints: Hints::Nothing,
            readings: self.dataset.readings(before, frame.stamp_ns),
        })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let frame = &self.dataset.frames[index];
        let world_from_object = self
            .site
            .objects
            .iter()
            .map(|object| {
                let moved = self.dataset.objects.iter().find(|(id, _)| *id == object.id).map(|(_, pose)| *pose);
                moved.or(object.world_from_object)
            })
            .collect();
        let index_of = |(object, point): &(String, String)| {
            let o = self.site.objects.iter().position(|candidate| candidate.id == *object)?;
            let p = self.site.objects[o].points.iter().position(|candidate| candidate.id == *point)?;
            Some((o, p))
        };
        Some(Truth {
            world_from_camera: frame.truth?,
            world_from_object,
            visible: self.dataset.has_visibility.then(|| frame.visible.iter().filter_map(index_of).collect()),
            bound: None,
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        input_hashes(&self.dataset.folder)
    }
}
