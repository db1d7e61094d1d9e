//! The stereo pairs of a data set, a ROS 2 recording or a log, for methods that need nothing else.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_io::ImageLimits;
use seafix_navigation::Reading;
use seafix_vision::{Image, RightCameraRotation};

use crate::{
    dataset::{
        Dataset, are_identical, identical_images_fault, is_one, odd_times, right_camera_rotation, rotation_of_sample,
        swap_of_first, swapped_at_first,
    },
    sequence::Sequence as _,
    source::{Bag, Logged, LoggedInput, Mcap, Recordings, is_log, is_recording},
};

/// A rig and its stereo pairs in order, without site, truth and prior.
pub struct StereoPairs {
    /// The stereo rig; its user may replace it by a corrected one.
    pub rig: StereoRig,
    /// The pose of the left camera in the vehicle; the identity if it is not stated.
    pub body_from_camera: Transform<Body, Camera>,
    /// The warnings about the data.
    pub warnings: Vec<Fault>,
    path: PathBuf,
    stamps: Vec<u64>,
    content: Content,
}

/// The place of the images.
enum Content {
    Dataset(Box<Dataset>),
    Recording(Box<Bag>),
    Log(Box<Logged>),
}

impl StereoPairs {
    /// Opens `path`: the folder of a data set, a recording of ROS 2 (an MCAP file or a folder of rosbag2) or the log of
    /// a trial with its images. `settings` select the topics of a recording; their `path`, site and poses are ignored.
    /// `sort-stamps` of them sorts the pairs of a data set as well.
    ///
    /// # Errors
    /// All faults of the file or folder, and a log without images.
    pub fn open(path: &Path, settings: &Mcap) -> Result<Self, Vec<Fault>> {
        let one = |fault| vec![fault];
        if !path.exists() {
            let fault = Fault::new("no such file or folder", path);
            return Err(one(fault.remedy("give a data set's folder, a recording of ROS 2 or the log of a trial")));
        }
        if is_one(path) {
            let limits = ImageLimits { pixels: settings.max_pixels, bytes: settings.max_bytes };
            let dataset = Dataset::open_pairs(path, settings.sort_stamps)?;
            return Ok(Self::of_dataset(dataset.within(limits)));
        }
        let has_one = || {
            let entries = std::fs::read_dir(path).into_iter().flatten().filter_map(Result::ok);
            entries.map(|entry| entry.path()).any(|file| file.extension().is_some_and(|end| end == "mcap"))
        };
        if path.is_dir() && !is_recording(path) && !has_one() {
            let fault = Fault::new("a folder without stereo pairs", path);
            return Err(one(fault.remedy(
                "give a folder with dataset.toml, EuRoC's mav0/cam0 or KITTI's calib.txt and image_0, a recording of \
                 ROS 2, or the log of a trial",
            )));
        }
        if is_log(&Recordings::open(path, |_| false).map_err(one)?) {
            return Logged::open(path, LoggedInput::Images).and_then(|log| Self::of_log(path, log));
        }
        let poses_of_none = Mcap { prior: String::new(), truth: String::new(), ..settings.clone() };
        Bag::open(path, &poses_of_none).map(|bag| Self::of_recording(path, bag)).map_err(one)
    }

    fn of_dataset(dataset: Dataset) -> Self {
        Self {
            rig: dataset.rig,
            body_from_camera: dataset.body_from_camera,
            warnings: dataset.warnings.iter().cloned().chain(dataset.odd_times()).collect(),
            path: dataset.folder.clone(),
            stamps: dataset.frames.iter().map(|frame| frame.stamp_ns).collect(),
            content: Content::Dataset(Box::new(dataset)),
        }
    }

    fn of_recording(path: &Path, bag: Bag) -> Self {
        let stamps: Vec<u64> = bag.pairs.iter().map(|(stamp, _)| *stamp).collect();
        let warnings = [bag.warnings.clone(), bag.doubts.clone(), odd_times(&stamps, path)].concat();
        let (rig, body_from_camera) = (bag.rig, Transform::identity());
        Self {
            rig,
            body_from_camera,
            warnings,
            path: path.to_owned(),
            stamps,
            content: Content::Recording(Box::new(bag)),
        }
    }

    fn of_log(path: &Path, log: Logged) -> Result<Self, Vec<Fault>> {
        let stamps = log.stamps().map_err(|fault| vec![fault])?;
        let warnings = [log.warnings().to_vec(), odd_times(&stamps, path)].concat();
        let (rig, body_from_camera) = (*log.rig(), log.body_from_camera());
        Ok(Self {
            rig,
            body_from_camera,
            warnings,
            path: path.to_owned(),
            stamps,
            content: Content::Log(Box::new(log)),
        })
    }

    /// The file or folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The times of the pairs (ns).
    pub fn stamps(&self) -> &[u64] {
        &self.stamps
    }

    /// The names of the left and the right image of pair `index` in messages: their files, or the file of all pairs
    /// with the time of this one.
    pub fn names(&self, index: usize) -> [PathBuf; 2] {
        match &self.content {
            Content::Dataset(dataset) => [dataset.frames[index].left.clone(), dataset.frames[index].right.clone()],
            Content::Recording(_) | Content::Log(_) => ["left", "right"]
                .map(|side| format!("{} at {} ns, {side}", self.path.display(), self.stamps[index]).into()),
        }
    }

    /// The two images of pair `index`.
    ///
    /// # Errors
    /// An image that cannot be read, a thumbnail in a log, or two identical images, which have no depth.
    pub fn pair(&self, index: usize) -> Result<(Image, Image), Fault> {
        let (left, right) = match &self.content {
            Content::Dataset(dataset) => dataset.pair(&dataset.frames[index])?,
            Content::Recording(bag) => bag.pair(index)?,
            Content::Log(log) => log.pair(index)?,
        };
        if are_identical(&left, &right) {
            return Err(match &self.content {
                Content::Dataset(dataset) => {
                    let frame = &dataset.frames[index];
                    identical_images_fault(&frame.left, &frame.right)
                }
                Content::Recording(_) | Content::Log(_) => {
                    let fault = Fault::new("identical left and right images", &self.path);
                    fault.value(format!("{} ns", self.stamps[index])).remedy("one image twice has no depth")
                }
            });
        }
        Ok((left, right))
    }

    /// Whether there are readings of both the Doppler log and the gyro.
    pub fn has_readings(&self) -> bool {
        match &self.content {
            Content::Dataset(dataset) => dataset.has_readings(),
            Content::Recording(_) => false,
            Content::Log(log) => log.has_readings(),
        }
    }

    /// The readings that arrive after the pair before `index`, up to this pair.
    ///
    /// # Errors
    /// A log that has changed since it was opened.
    pub fn readings(&self, index: usize) -> Result<Vec<Reading>, Fault> {
        match &self.content {
            Content::Dataset(dataset) => {
                let before = index.checked_sub(1).map(|before| self.stamps[before]);
                Ok(dataset.readings(before, self.stamps[index]))
            }
            Content::Recording(_) => Ok(Vec::new()),
            Content::Log(log) => log.readings(index),
        }
    }

    /// The fault of exchanged left and right images, by the first pairs that tell.
    pub fn swapped(&self) -> Option<Fault> {
        match &self.content {
            Content::Dataset(dataset) => swapped_at_first(dataset),
            // Opening a recording has checked it.
            Content::Recording(_) => None,
            Content::Log(_) => {
                let pairs = (0..self.stamps.len()).filter_map(|index| self.pair(index).ok());
                swap_of_first(pairs, &self.rig, &self.path)
            }
        }
    }

    /// The rig with an estimated rotation of the right camera; `None` if the images agree with the rig. Unreadable
    /// images are ignored.
    pub fn right_camera_rotation(&self) -> Option<RightCameraRotation> {
        match &self.content {
            Content::Dataset(dataset) => right_camera_rotation(dataset),
            Content::Recording(_) | Content::Log(_) => {
                rotation_of_sample(self.stamps.len(), |index| self.pair(index).ok(), &self.rig)
            }
        }
    }
}
