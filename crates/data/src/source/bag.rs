//! The stereo rig and the stereo pairs in a ROS 2 recording.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use seafix_component::Fault;
use seafix_geometry::{Pinhole, Pixel, StereoPixels, StereoRig};
use seafix_io::{
    ImageLimits,
    image::{decode_image, image_of_samples},
    unit_fault,
};
use seafix_log::Topic;
use seafix_vision::{Image, Sides, matches_by_appearance};

use super::{
    bag_messages::{Messages, Poses, Readings, message_fault},
    mcap::Mcap,
    recordings::{Message, Recordings},
    topics::Topics,
};
use crate::{
    contradictions::{images_fault, mosaic_fault, residual},
    dataset::{INSPECTED_PAIRS, are_identical, constant_offset, left_out, pairs, strangers, swap_fault},
    ros::{self, CompressedImage, Mosaic, Tree},
};

/// The stereo rig and pairs of a recording; every image has been decoded once.
pub(crate) struct Bag {
    path: PathBuf,
    recording: Recordings,
    settings: Mcap,
    topics: Topics,
    tree: Tree,
    /// The coordinate frames of the cameras.
    frames: [String; 2],
    pub(crate) rig: StereoRig,
    /// What the images are taken for, and why.
    views: String,
    /// The stamp and the two messages of each pair.
    pub(crate) pairs: Vec<(u64, [Message; 2])>,
    pub(crate) warnings: Vec<Fault>,
    /// The contradictions between images and rig.
    pub(crate) doubts: Vec<Fault>,
    /// The matches of some pairs, by the index of the pair.
    pub(super) inspected: Vec<(usize, Vec<StereoPixels>)>,
}

impl Bag {
    /// Reads `path`, decodes every image, and checks rig and images for consistency. A pair with an unreadable image is
    /// skipped with a warning; at least half of the pairs must be readable.
    pub(crate) fn open(path: &Path, settings: &Mcap) -> Result<Self, Fault> {
        let recording = Recordings::open(path, |topic: &Topic| topic.encoding == "cdr")?;
        let topics = Topics::of(path, &recording, settings)?;
        let mut warnings = Vec::new();
        if !recording.is_protected() {
            warnings.push(Fault::new("no check sums", path).remedy("damage cannot be detected; record with CRCs"));
        }
        let mut reader = Messages { path, recording: &recording, settings, warnings };
        let infos = [reader.info(&topics.infos[0])?, reader.info(&topics.infos[1])?];
        let tree = reader.tree()?;
        let images = [reader.stamps(&topics.images[0])?, reader.stamps(&topics.images[1])?];
        let frames = [0, 1].map(|side| images[side].first().map_or_else(String::new, |(_, _, frame)| frame.clone()));
        let readings = reader.readings(&topics, &infos, &tree, &frames)?;
        let stamps = [0, 1].map(|side| images[side].iter().map(|image| image.0).collect::<Vec<u64>>());
        let found = pairs(&stamps[0], &stamps[1], (settings.tolerance * 1e9) as u64);
        if 2 * found.len() < stamps[0].len().max(stamps[1].len()) {
            // A constant difference of the clocks explains more than a count of images without partners.
            constant_offset(&stamps[0], &stamps[1], path).map_or(Ok(()), Err)?;
        }
        let left = left_out(found.len(), [stamps[0].len(), stamps[1].len()], path);
        reader.warnings.extend(left?);
        if found.is_empty() {
            return Err(Fault::new("no stereo pair", path)
                .remedy("no two images have stamps within `tolerance`; enlarge it or check the topics"));
        }
        let pairs: Vec<(u64, [Message; 2])> =
            found.iter().map(|&(i, j)| (images[0][i].0, [images[0][i].1, images[1][j].1])).collect();
        let warnings = reader.warnings;
        let (path, settings) = (path.to_owned(), settings.clone());
        // The sizes of both readings are those of the images.
        let (rig, views) = readings.first();
        let mut bag = Self {
            path,
            recording,
            settings,
            topics,
            tree,
            frames,
            rig,
            views,
            pairs,
            warnings,
            doubts: Vec::new(),
            inspected: Vec::new(),
        };
        bag.inspect_images()?;
        bag.decide(readings)?;
        if let Some(fault) = unit_fault(&bag.rig, &bag.path) {
            return Err(fault.value(format!("{:.4} m in {}", bag.rig.baseline(), bag.topics.infos[1])));
        }
        bag.appear_at_the_sides()?;
        Ok(bag)
    }

    /// The two images of a pair.
    pub(crate) fn pair(&self, index: usize) -> Result<(Image, Image), Fault> {
        let [left, right] = &self.pairs[index].1;
        self.decoded([left, right], [&self.recording.bytes(left)?, &self.recording.bytes(right)?])
    }

    /// The files of the recording.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.recording.paths()
    }

    /// The poses of the left camera at the stamps of the pairs, with covariances if there are any. `said` is a topic of
    /// poses, or `tf:FRAME` for the pose of the camera in that frame.
    pub(super) fn poses(&self, text: &str) -> Result<Poses, Fault> {
        let (recording, settings) = (&self.recording, &self.settings);
        let reader = Messages { path: &self.path, recording, settings, warnings: Vec::new() };
        let at: Vec<u64> = self.pairs.iter().map(|(stamp, _)| *stamp).collect();
        reader.poses(text, &self.tree, &self.frames[0], &at)
    }

    /// A summary in one line.
    pub(super) fn notes(&self) -> String {
        let ([left, right], [w, h]) = (&self.topics.images, self.rig.left().size());
        let (first, last) = (self.pairs[0].0, self.pairs[self.pairs.len() - 1].0);
        let is_pose = |topic: &&Topic| ros::POSES.contains(&ros::plain(&topic.schema).as_str());
        let poses = self.recording.topics().iter().filter(is_pose);
        let poses: Vec<String> = poses.map(|topic| format!("`{}`", topic.name)).collect();
        format!(
            "{} pairs of {w}×{h} from `{left}` and `{right}` over {:.1} s, {}, baseline {:.4} m; odometry: {}",
            self.pairs.len(),
            (last - first) as f64 * 1e-9,
            self.views,
            self.rig.baseline(),
            if poses.is_empty() { "none".to_owned() } else { poses.join(", ") }
        )
    }

    /// Decodes all pairs once and skips the unreadable ones, so that none stops a run midway.
    fn inspect_images(&mut self) -> Result<(), Fault> {
        /// The number of pairs that are decoded in parallel, in the order of the file.
        const AT_ONCE: usize = 16;
        /// The maximum number of skipped pairs with a warning of their own.
        const REPORTED: usize = 10;
        let bytes = |message: &Message| self.recording.bytes(message);
        let mut seen: Vec<Result<bool, Fault>> = Vec::with_capacity(self.pairs.len());
        for some in self.pairs.chunks(AT_ONCE) {
            let read = some.iter().map(|(_, [left, right])| Ok([bytes(left)?, bytes(right)?]));
            let read = read.collect::<Result<Vec<_>, Fault>>()?;
            let inspect = |((_, [left, right]), [l, r]): (&(u64, [Message; 2]), &[Vec<u8>; 2])| {
                self.decoded([left, right], [l, r]).map(|(left, right)| are_identical(&left, &right))
            };
            seen.extend(some.par_iter().zip(&read).map(inspect).collect::<Vec<_>>());
        }
        let all = self.pairs.len();
        let identical = seen.iter().filter(|one| **one == Ok(true)).count();
        if identical > 0 {
            let fault = Fault::new("identical left and right images", &self.path);
            let [left, right] = &self.topics.images;
            let fault = fault.value(format!("{left} and {right}, {identical} of {all} pairs"));
            return Err(fault.remedy("name the topic of the other camera; one image twice has no depth"));
        }
        let lost: Vec<Fault> = seen.iter().filter_map(|one| one.clone().err()).collect();
        if 2 * lost.len() > all {
            let remedy = format!("{} of {all} pairs are unreadable; at least half must be readable", lost.len());
            return Err(Fault { remedy, ..lost[0].clone() });
        }
        let more = lost.len().saturating_sub(REPORTED);
        if more > 0 {
            let fault = Fault::new("unreadable pairs", &self.path).value(format!("{} of {all}", lost.len()));
            self.warnings.push(fault.remedy("they are skipped"));
        }
        let reported =
            lost.into_iter().take(REPORTED).map(|fault| Fault { remedy: "its pair is skipped".to_owned(), ..fault });
        self.warnings.extend(reported);
        let mut readable = seen.iter().map(Result::is_ok);
        self.pairs.retain(|_| readable.next().unwrap_or(false));
        Ok(())
    }

    /// Decides between raw and rectified images by the distances of matches to the epipolar lines of both readings.
    fn decide(&mut self, readings: Readings) -> Result<(), Fault> {
        let Readings::Two { raw, rectified } = readings else { return Ok(()) };
        let (raw, rectified) = (*raw, *rectified);
        let apart = largest_difference(&raw, &rectified);
        if apart < SAME_PIXEL {
            (self.rig, self.views) = (raw, format!("raw or rectified, which differ by {apart:.3} px at most"));
            return Ok(());
        }
        let step = self.pairs.len().div_ceil(INSPECTED_PAIRS).max(1);
        let mut seen = Vec::new();
        for index in (0..self.pairs.len()).step_by(step) {
            let (left, right) = self.pair(index)?;
            seen.extend(matches_by_appearance(&left, &right, &raw));
        }
        let residuals = [&raw, &rectified].map(|rig| residual(&seen, rig));
        let said =
            format!("{:.2} px from the epipolar lines as raw, {:.2} px as rectified", residuals[0], residuals[1]);
        let (rig, views) = match decision(residuals, seen.len()) {
            Some(false) => (raw, format!("taken as raw ({said})")),
            Some(true) => (rectified, format!("taken as rectified ({said})")),
            None => {
                let fault = Fault::new("images that may be raw or rectified", &self.path).value(said);
                return Err(fault.remedy("set `images` to \"raw\" (K and D hold) or \"rectified\" (P holds)"));
            }
        };
        (self.rig, self.views) = (rig, views);
        Ok(())
    }

    /// Checks a sample of pairs for exchanged left and right images.
    fn appear_at_the_sides(&mut self) -> Result<(), Fault> {
        let step = self.pairs.len().div_ceil(INSPECTED_PAIRS).max(1);
        let (mut sides, mut seen, mut doubts) = (Sides::default(), Vec::new(), Vec::new());
        for index in (0..self.pairs.len()).step_by(step) {
            let (left, right) = self.pair(index)?;
            sides = sides + Sides::of_images(&left, &right, &self.rig);
            let matches = matches_by_appearance(&left, &right, &self.rig);
            seen.extend(matches.iter().copied());
            self.inspected.push((index, matches));
            if doubts.is_empty() {
                doubts.extend(mosaic_fault(&left, &self.path).map(|fault| {
                    let value = format!("{}: {}", self.topics.images[0], fault.value);
                    fault.value(value)
                }));
            }
        }
        doubts.extend(images_fault(&seen, &self.rig, &self.path));
        self.doubts = doubts;
        if let Some(fault) = swap_fault(sides, &self.path) {
            return Err(fault.remedy("exchange the topics `left` and `right`, or `left-info` and `right-info`"));
        }
        self.warnings.extend(strangers(sides, &self.path));
        // The centre of the left camera in the right camera's frame is t; a positive x puts the right camera on the
        // left.
        let t = self.rig.right_from_left().translation();
        if t.x > 0.5 * t.norm() {
            let fault = Fault::new("a left camera to the right of the right camera", &self.path);
            let fault = fault.value(format!("{} by {:.4} m", self.topics.images[0], t.x));
            self.warnings.push(fault.remedy("exchange `left` and `right` unless this is intended"));
        }
        Ok(())
    }

    fn decoded(&self, entries: [&Message; 2], bytes: [&[u8]; 2]) -> Result<(Image, Image), Fault> {
        let [left, right] = [self.rig.left(), self.rig.right()];
        Ok((self.image(entries[0], bytes[0], left)?, self.image(entries[1], bytes[1], right)?))
    }

    /// The image of a message.
    fn image(&self, entry: &Message, bytes: &[u8], camera: &Pinhole) -> Result<Image, Fault> {
        let topic = &self.recording.topics()[entry.topic];
        let broken = |what: String| message_fault(&self.path, topic, entry, &what);
        let limits = ImageLimits { pixels: self.settings.max_pixels, bytes: self.settings.max_bytes };
        if ros::plain(&topic.schema) == "sensor_msgs/CompressedImage" {
            let message = CompressedImage::decode(bytes).map_err(broken)?;
            let place = PathBuf::from(format!("{} ({} at {} ns)", self.path.display(), topic.name, entry.log_time));
            let image = decode_image(message.data, &place, camera.size(), self.settings.bits, limits)?;
            let mosaic = Mosaic::of(message.format.split([';', ' ']).next().unwrap_or_default());
            let lossy = message.data.starts_with(&[0xFF, 0xD8]);
            return match mosaic {
                Some(_) if lossy => {
                    Err(broken("a Bayer mosaic compressed as JPEG, which mixes its colours".to_owned()))
                }
                Some(mosaic) => Ok(mosaic.grey(&image)),
                None => Ok(image),
            };
        }
        let message = ros::Image::decode(bytes).map_err(broken)?;
        if message.size != camera.size() {
            let ([w, h], [cw, ch]) = (message.size, camera.size());
            return Err(broken(format!("an image of {w}×{h} from a camera calibrated for {cw}×{ch}")));
        }
        let (samples, white) = message.samples(self.settings.bits).map_err(broken)?;
        let image = image_of_samples(&samples, message.size, white).map_err(|fault| broken(fault.what))?;
        Ok(Mosaic::of(&message.encoding).map_or_else(|| image.clone(), |mosaic| mosaic.grey(&image)))
    }
}

/// The maximum difference (px) of two readings that need no decision.
const SAME_PIXEL: f64 = 0.05;

/// The largest difference (px) of the directions of a pixel in two readings of the same images, over both images; the
/// difference of the cameras' poses is added.
fn largest_difference(raw: &StereoRig, rectified: &StereoRig) -> f64 {
    const STEPS: u32 = 8;
    let of = |a: &Pinhole, b: &Pinhole| {
        let [width, height] = a.size().map(|length| f64::from(length - 1));
        let places = (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j)));
        let off = |(i, j): (u32, u32)| {
            let place = |k: u32, length: f64| length * f64::from(k) / f64::from(STEPS);
            let pixel = Pixel { u: place(i, width), v: place(j, height) };
            match (a.normalize(&pixel), b.normalize(&pixel)) {
                (Some(one), Some(other)) => (one - other).norm() * a.focal()[0],
                _ => f64::INFINITY,
            }
        };
        places.map(off).fold(0.0, f64::max)
    };
    let (a, b) = (raw.right_from_left(), rectified.right_from_left());
    let moved = (a.translation() - b.translation()).norm() / raw.baseline();
    let posed = (a.rotation().angle_to(&b.rotation()) + moved) * raw.mean_focal();
    of(raw.left(), rectified.left()).max(of(raw.right(), rectified.right())) + posed
}

/// Whether the images are rectified, by the residuals of the readings as raw and as rectified; `None` if they do not
/// tell.
fn decision([raw, rectified]: [f64; 2], matches: usize) -> Option<bool> {
    /// The minimum number of matches.
    const FEW: usize = 30;
    /// The minimum ratio of the residuals.
    const CLEAR: f64 = 1.5;
    match () {
        () if matches < FEW => None,
        () if raw * CLEAR < rectified => Some(false),
        () if rectified * CLEAR < raw => Some(true),
        () => None,
    }
}
