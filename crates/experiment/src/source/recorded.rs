//! What a recording of ROS 2 holds of a stereo rig.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Covariance6, Frame, Pinhole, StereoRig, Transform, World};
use seafix_log::{Entry, Recording, Topic};
use seafix_referencing::Site;
use seafix_vision::Image;

use super::{Eyes, Mcap, Passage, Sight, Told, Truth, WorldPrior, logged::fault, topics::Topics};
use crate::{
    dataset::{
        ImageLimits, decode_image, image_of_samples, left_out, pairs, sha256,
        tum::{Stamped, between},
    },
    read_text,
    ros::{self, CameraInfo, CompressedImage, Odometry, Tree},
};

/// Stereo pairs, calibration and poses out of a recording of ROS 2.
pub(super) struct Recorded {
    path: PathBuf,
    recording: Recording,
    settings: Mcap,
    site: Site,
    rig: StereoRig,
    /// Stamp and messages of each pair.
    pairs: Vec<(u64, [Entry; 2])>,
    prior: Vec<Stamped<World, Camera>>,
    /// The prior's covariances, one a pose, or one for all.
    covariances: Vec<Covariance6<World, Camera>>,
    truth: Vec<Stamped<World, Camera>>,
    warnings: Vec<Fault>,
}

/// Some frame that ROS names.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Child;
impl Frame for Child {}

impl Recorded {
    /// Reads `path` through and checks what can be checked without decoding images.
    pub(super) fn open(path: &Path, settings: &Mcap, folder: &Path) -> Result<Self, Vec<Fault>> {
        Self::read(path, settings, folder).map_err(|fault| vec![fault]).and_then(|recorded| recorded)
    }

    fn read(path: &Path, settings: &Mcap, folder: &Path) -> Result<Result<Self, Vec<Fault>>, Fault> {
        let recording =
            Recording::open(path, |topic: &Topic| topic.encoding == "cdr").map_err(|error| fault(path, &error))?;
        let topics = Topics::of(path, &recording, settings)?;
        let mut warnings = Vec::new();
        if !recording.is_protected() {
            warnings.push(Fault::new("no check sums", path).remedy("damage would not be noticed"));
        }
        let mut reader = Messages { path, recording: &recording, settings, warnings };
        let infos = [reader.info(&topics.infos[0])?, reader.info(&topics.infos[1])?];
        let tree = reader.tree()?;
        let images = [reader.stamps(&topics.images[0])?, reader.stamps(&topics.images[1])?];
        let frames = [0, 1].map(|side| images[side].first().map_or_else(String::new, |(_, _, frame)| frame.clone()));
        let rig = reader.rig(&topics, &infos, &tree, &frames)?;
        let stamps = [0, 1].map(|side| images[side].iter().map(|image| image.0).collect::<Vec<u64>>());
        let tolerance = (settings.tolerance * 1e9) as u64;
        let found = pairs(&stamps[0], &stamps[1], tolerance);
        let left = left_out(found.len(), [stamps[0].len(), stamps[1].len()], path);
        reader.warnings.extend(left?);
        if found.is_empty() {
            return Err(Fault::new("no stereo pair", path).remedy("no two images are of one instant; see `tolerance`"));
        }
        let pairs: Vec<(u64, [Entry; 2])> =
            found.iter().map(|&(i, j)| (images[0][i].0, [images[0][i].1, images[1][j].1])).collect();
        let at: Vec<u64> = pairs.iter().map(|(stamp, _)| *stamp).collect();
        let (prior, covariances) = reader.poses(&settings.prior, &tree, &frames[0], &at)?;
        let covariances = match (covariances, prior.is_empty(), settings.prior_sigma()) {
            (_, true, _) => Vec::new(),
            (_, false, Some((position, attitude))) => vec![Covariance6::isotropic(attitude, position)],
            (Some(covariances), false, None) => covariances,
            (None, false, None) => {
                return Err(Fault::new("a prior without its uncertainty", path)
                    .value(&settings.prior)
                    .remedy("set `prior-position` (m) and `prior-attitude-deg`"));
            }
        };
        let (truth, _) = reader.poses(&settings.truth, &tree, &frames[0], &at)?;
        let mut warnings = reader.warnings;
        for (name, given, poses) in [("prior", &settings.prior, &prior), ("truth", &settings.truth, &truth)] {
            let without = at.iter().filter(|stamp| between(poses, **stamp, settings.gap_ns()).is_none()).count();
            if !given.is_empty() && without > 0 {
                let fault = Fault::new(format!("stereo pairs without a {name}"), path);
                let value = format!("{without} of {}, {given}", at.len());
                warnings
                    .push(fault.value(value).remedy("poses farther apart than `most-gap` say nothing between them"));
            }
        }
        let file = folder.join(&settings.site);
        let text = read_text(&file)?;
        let site = match Site::parse(&text, &file) {
            Ok(site) => site,
            Err(faults) => return Ok(Err(faults)),
        };
        warnings.extend(site.warnings.clone());
        let (path, settings) = (path.to_owned(), settings.clone());
        Ok(Ok(Self { path, settings, site, rig, pairs, prior, covariances, truth, warnings, recording }))
    }

    /// The image in a message.
    fn image(&self, entry: &Entry, camera: &Pinhole) -> Result<Image, Fault> {
        let topic = &self.recording.topics()[entry.topic];
        let broken = |what: String| message_fault(&self.path, topic, entry, &what);
        let bytes = self.recording.message(entry).map_err(|error| fault(&self.path, &error))?;
        let limits = ImageLimits { pixels: self.settings.max_pixels, bytes: self.settings.max_bytes };
        if ros::plain(&topic.schema) == "sensor_msgs/CompressedImage" {
            let message = CompressedImage::decode(&bytes).map_err(broken)?;
            let place = PathBuf::from(format!("{} ({} at {} ns)", self.path.display(), topic.name, entry.log_time));
            return decode_image(message.data, &place, camera.size(), self.settings.bits, limits);
        }
        let message = ros::Image::decode(&bytes).map_err(broken)?;
        if message.size != camera.size() {
            let ([w, h], [cw, ch]) = (message.size, camera.size());
            return Err(broken(format!("an image of {w}×{h} from a camera calibrated for {cw}×{ch}")));
        }
        let (samples, white) = message.samples(self.settings.bits).map_err(broken)?;
        image_of_samples(&samples, message.size, white).map_err(|fault| broken(fault.what))
    }
}

/// What is wrong with a message.
fn message_fault(path: &Path, topic: &Topic, entry: &Entry, what: &str) -> Fault {
    Fault::new(what, path).value(format!("{} message {} at {} ns", topic.name, entry.sequence, entry.log_time))
}

/// Reads messages of a recording.
struct Messages<'a> {
    path: &'a Path,
    recording: &'a Recording,
    settings: &'a Mcap,
    warnings: Vec<Fault>,
}

impl Messages<'_> {
    fn of<'s>(&'s self, topic: &'s str) -> impl Iterator<Item = &'s Entry> {
        self.recording.entries().iter().filter(move |entry| self.recording.topics()[entry.topic].name == topic)
    }

    fn read<T>(&self, entry: &Entry, decode: impl Fn(&[u8]) -> Result<T, String>) -> Result<T, Fault> {
        let bytes = self.recording.message(entry).map_err(|error| fault(self.path, &error))?;
        decode(&bytes).map_err(|what| message_fault(self.path, &self.recording.topics()[entry.topic], entry, &what))
    }

    /// The first calibration on a topic.
    fn info(&self, topic: &str) -> Result<CameraInfo, Fault> {
        let first = self.of(topic).next();
        let entry = first.ok_or_else(|| Fault::new("a topic without messages", self.path).value(topic))?;
        let info = self.read(entry, CameraInfo::decode)?;
        for later in self.of(topic).skip(1) {
            let other = self.read(later, CameraInfo::decode)?;
            if !info.is_of_one_camera_with(&other) {
                let value = format!("{topic}: the message of {} ns", other.header.stamp_ns);
                let fault = Fault::new("a calibration that changes within the recording", self.path).value(value);
                return Err(fault.remedy("cut the recording there and run its parts by themselves"));
            }
        }
        Ok(info)
    }

    /// Stamp, message and coordinate frame of each image, in order of time.
    fn stamps(&mut self, topic: &str) -> Result<Vec<(u64, Entry, String)>, Fault> {
        let mut images: Vec<(u64, Entry, String)> = Vec::new();
        for entry in self.of(topic) {
            let header = self.read(entry, ros::stamp)?;
            images.push((header.stamp_ns, *entry, header.frame));
        }
        let fault = |what: &str, at: &(u64, Entry, String)| {
            let fault = Fault::new(what, self.path).value(format!("{topic}: {} ns", at.0));
            fault.remedy("`repair = true` sorts them and keeps the first of each stamp")
        };
        let wrong = images.windows(2).find(|pair| pair[0].0 >= pair[1].0);
        if let (Some([before, after]), false) = (wrong, self.settings.repair) {
            let what = if before.0 == after.0 { "two images with one stamp" } else { "stamps that go back" };
            return Err(fault(what, after));
        }
        images.sort_by_key(|image| image.0);
        images.dedup_by_key(|image| image.0);
        const YEAR_NS: u64 = 31_557_600_000_000_000;
        if let Some((stamp, entry, _)) =
            images.iter().find(|(stamp, entry, _)| stamp.abs_diff(entry.log_time) > YEAR_NS)
        {
            let value = format!("{topic}: taken at {stamp} ns, recorded at {} ns", entry.log_time);
            let fault = Fault::new("clocks that are more than a year apart", self.path).value(value);
            self.warnings.push(fault.remedy("do seconds and nanoseconds mix? the time of capture is used"));
        }
        Ok(images)
    }

    fn tree(&self) -> Result<Tree, Fault> {
        let mut tree = Tree::default();
        for (topic, is_static) in [("/tf", false), ("/tf_static", true)] {
            for entry in self.of(topic) {
                for transform in self.read(entry, ros::transforms)? {
                    tree.add(transform, is_static);
                }
            }
        }
        tree.sort();
        Ok(tree)
    }

    fn rig(
        &self,
        topics: &Topics,
        infos: &[CameraInfo; 2],
        tree: &Tree,
        frames: &[String; 2],
    ) -> Result<StereoRig, Fault> {
        let rectified = self.settings.images.rectified(&topics.images[0]);
        let fault = |side: usize, what: String| Fault::new(what, self.path).value(&topics.infos[side]);
        let camera = |side: usize| ros::camera(&infos[side], rectified).map_err(|what| fault(side, what));
        let calibrated = ros::right_from_left(&infos[0], &infos[1], rectified).map_err(|what| fault(1, what))?;
        let [left, right] = frames;
        let stamp = infos[0].header.stamp_ns;
        let stands = calibrated.or_else(|| tree.look_up(right, left, stamp, self.settings.gap_ns()));
        let stands = stands.ok_or_else(|| {
            let remedy =
                format!("give the right camera's P a baseline (P[3] = −fx·b), or a transform `{left}` → `{right}`");
            fault(1, "no baseline".to_owned()).remedy(remedy)
        })?;
        StereoRig::new(camera(0)?, camera(1)?, stands).map_err(|error| fault(1, error.to_string()))
    }

    /// The poses of the left camera that `said` names, and their covariances where they have any: a topic of odometry,
    /// or `tf:FRAME`, the camera in that frame.
    #[expect(clippy::type_complexity, reason = "two lists of one length")]
    fn poses(
        &self,
        said: &str,
        tree: &Tree,
        camera: &str,
        stamps: &[u64],
    ) -> Result<(Vec<Stamped<World, Camera>>, Option<Vec<Covariance6<World, Camera>>>), Fault> {
        let gap = self.settings.gap_ns();
        if said.is_empty() {
            return Ok((Vec::new(), None));
        }
        if let Some(frame) = said.strip_prefix("tf:") {
            let poses: Vec<_> =
                stamps.iter().filter_map(|&stamp| Some((stamp, tree.look_up(frame, camera, stamp, gap)?))).collect();
            if poses.is_empty() {
                let fault =
                    Fault::new("no transform that leads there", self.path).value(format!("`{frame}` from `{camera}`"));
                return Err(fault.remedy("is the name of the frame right?"));
            }
            return Ok((poses, None));
        }
        let (mut poses, mut covariances) = (Vec::new(), Vec::new());
        for entry in self.of(said) {
            let message = self.read(entry, Odometry::decode)?;
            let child_from_camera: Transform<Child, Camera> = match message.child.trim_start_matches('/') {
                "" => Transform::identity(),
                child if child == camera.trim_start_matches('/') => Transform::identity(),
                child => tree.look_up(child, camera, message.header.stamp_ns, gap).ok_or_else(|| {
                    let fault = Fault::new("no transform from the camera to the vehicle", self.path);
                    fault.value(format!("`{child}` from `{camera}`")).remedy("record /tf_static")
                })?,
            };
            let world_from_child: Transform<World, Child> = message.pose.transform();
            poses.push((message.header.stamp_ns, world_from_child * child_from_camera));
            covariances.push(ros::covariance(&message, &child_from_camera));
        }
        if poses.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
            return Err(Fault::new("stamps that do not increase", self.path).value(said));
        }
        if poses.is_empty() {
            return Err(Fault::new("a topic without messages", self.path).value(said));
        }
        Ok((poses, covariances.into_iter().collect()))
    }
}

impl Passage for Recorded {
    fn name(&self) -> &str {
        self.path.file_name().and_then(|name| name.to_str()).unwrap_or("recording")
    }

    fn site(&self) -> &Site {
        &self.site
    }

    fn rig(&self) -> &StereoRig {
        &self.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        Transform::identity()
    }

    fn images(&self) -> bool {
        true
    }

    fn frames(&self) -> usize {
        self.pairs.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let covariance = self.covariances.first()?;
        Some((covariance.position_sigma() / 3f64.sqrt(), covariance.attitude_sigma() / 3f64.sqrt()))
    }

    fn warnings(&self) -> &[Fault] {
        &self.warnings
    }

    fn sight(&self, index: usize) -> Result<Sight, Fault> {
        let (stamp_ns, [left, right]) = &self.pairs[index];
        let eyes = Eyes::Pair(self.image(left, self.rig.left())?, self.image(right, self.rig.right())?);
        let prior = between(&self.prior, *stamp_ns, self.settings.gap_ns()).map(|world_from_camera| {
            let nearest = self.prior.partition_point(|(time, _)| time < stamp_ns).min(self.covariances.len() - 1);
            WorldPrior { world_from_camera, covariance: self.covariances[nearest] }
        });
        Ok(Sight { stamp_ns: *stamp_ns, eyes, prior, told: Told::Nothing, readings: Vec::new() })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let world_from_camera = between(&self.truth, self.pairs[index].0, self.settings.gap_ns())?;
        Some(Truth {
            world_from_camera,
            world_from_object: self.site.objects.iter().map(|object| object.world_from_object).collect(),
            visible: None,
            bound: None,
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        Ok(vec![(self.name().to_owned(), sha256(&self.path)?)])
    }
}
