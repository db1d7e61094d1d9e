//! The calibration, the stamps and the poses in the messages of a recording.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Frame, StereoRig, Transform, World};
use seafix_log::Topic;

use super::{
    mcap::{Mcap, Stamps},
    recordings::{Message, Recordings},
    topics::Topics,
};
use crate::{
    dataset::tum::Stamped,
    ros::{self, CameraInfo, Tree, Views},
};

/// The possible rigs of the images.
pub(super) enum Readings {
    /// The only one, and why.
    One(Box<StereoRig>, String),
    /// The calibration allows both.
    Two { raw: Box<StereoRig>, rectified: Box<StereoRig> },
}

impl Readings {
    /// The rig to begin with, and why if it is the only one.
    pub(super) fn first(&self) -> (StereoRig, String) {
        match self {
            Self::One(rig, why) => (**rig, why.clone()),
            Self::Two { raw, .. } => (**raw, String::new()),
        }
    }
}

/// A coordinate frame named by ROS.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Child;
impl Frame for Child {}

/// Poses of the left camera, with covariances if the topic has any.
pub(super) type Poses = (Vec<Stamped<World, Camera>>, Option<Vec<Covariance6<World, Camera>>>);

/// The fault of a message.
pub(super) fn message_fault(path: &Path, topic: &Topic, entry: &Message, what: &str) -> Fault {
    Fault::new(what, path).value(format!("{} message {} at {} ns", topic.name, entry.sequence, entry.log_time))
}

/// A reader of messages of a recording.
pub(super) struct Messages<'a> {
    pub(super) path: &'a Path,
    pub(super) recording: &'a Recordings,
    pub(super) settings: &'a Mcap,
    pub(super) warnings: Vec<Fault>,
}

impl Messages<'_> {
    fn of<'s>(&'s self, topic: &'s str) -> impl Iterator<Item = &'s Message> {
        self.recording.messages().iter().filter(move |entry| self.recording.topics()[entry.topic].name == topic)
    }

    fn read<T>(&self, entry: &Message, decode: impl Fn(&[u8]) -> Result<T, String>) -> Result<T, Fault> {
        let bytes = self.recording.bytes(entry)?;
        decode(&bytes).map_err(|what| message_fault(self.path, &self.recording.topics()[entry.topic], entry, &what))
    }

    /// The first calibration on a topic.
    pub(super) fn info(&self, topic: &str) -> Result<CameraInfo, Fault> {
        let first = self.of(topic).next();
        let entry = first.ok_or_else(|| Fault::new("a topic without messages", self.path).value(topic))?;
        let info = self.read(entry, CameraInfo::decode)?;
        for later in self.of(topic).skip(1) {
            let other = self.read(later, CameraInfo::decode)?;
            if !info.is_of_one_camera_with(&other) {
                let value = format!("{topic}: the message of {} ns", other.header.stamp_ns);
                let fault = Fault::new("a calibration that changes within the recording", self.path).value(value);
                return Err(fault.remedy("split the recording there and run its parts separately"));
            }
        }
        Ok(info)
    }

    /// The stamp, message and coordinate frame of each image, in order of time.
    pub(super) fn stamps(&mut self, topic: &str) -> Result<Vec<(u64, Message, String)>, Fault> {
        let mut images: Vec<(u64, Message, String)> = Vec::new();
        for entry in self.of(topic) {
            let header = self.read(entry, ros::stamp)?;
            let stamp_ns = if self.settings.stamps == Stamps::Log { entry.log_time } else { header.stamp_ns };
            images.push((stamp_ns, *entry, header.frame));
        }
        self.all_set(topic, images.iter().map(|image| image.0))?;
        let fault = |what: &str, at: &(u64, Message, String)| {
            let fault = Fault::new(what, self.path).value(format!("{topic}: {} ns", at.0));
            fault.remedy("`sort-stamps = true` sorts them and keeps the first of each stamp")
        };
        let wrong = images.windows(2).find(|pair| pair[0].0 >= pair[1].0);
        if let (Some([before, after]), false) = (wrong, self.settings.sort_stamps) {
            let what = if before.0 == after.0 { "two images with one stamp" } else { "decreasing stamps" };
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
            self.warnings.push(fault.remedy("check the units (s, ns) of the driver; the time of capture is used"));
        }
        Ok(images)
    }

    /// Rejects a topic of which half of the stamps were never set.
    fn all_set(&self, topic: &str, stamps: impl ExactSizeIterator<Item = u64>) -> Result<(), Fault> {
        let all = stamps.len();
        let unset = stamps.filter(|stamp| *stamp == 0).count();
        if unset == 0 || 2 * unset < all {
            return Ok(());
        }
        let value = format!("{topic}: 0 in {unset} of {all} messages");
        let fault = Fault::new("stamps that were never set", self.path).value(value);
        Err(fault.remedy(
            "`stamps = \"log\"` takes the times of recording, which vary by the transport; better let the driver set \
             header.stamp",
        ))
    }

    pub(super) fn tree(&self) -> Result<Tree, Fault> {
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

    /// The rigs of raw and of rectified images, as far as the settings and the calibration allow them.
    pub(super) fn readings(
        &self,
        topics: &Topics,
        infos: &[CameraInfo; 2],
        tree: &Tree,
        frames: &[String; 2],
    ) -> Result<Readings, Fault> {
        let of = |rectified: bool| self.rig(topics, infos, tree, frames, rectified);
        match self.settings.images {
            Views::Raw => Ok(Readings::One(Box::new(of(false)?), "raw, as set".to_owned())),
            Views::Rectified => Ok(Readings::One(Box::new(of(true)?), "rectified, as set".to_owned())),
            Views::Auto => match (of(false), of(true)) {
                (Ok(raw), Ok(rectified)) if raw.is_rectified() && raw.left() == rectified.left() => {
                    Ok(Readings::One(Box::new(rectified), "rectified: K without distortion is P".to_owned()))
                }
                (Ok(raw), Ok(rectified)) => Ok(Readings::Two { raw: Box::new(raw), rectified: Box::new(rectified) }),
                (Ok(raw), Err(_)) => Ok(Readings::One(Box::new(raw), "raw: P is no camera".to_owned())),
                (Err(_), Ok(rectified)) if infos.iter().all(ros::is_without_raw_model) => {
                    Ok(Readings::One(Box::new(rectified), "rectified: K is no camera".to_owned()))
                }
                (Err(fault), _) => Err(fault),
            },
        }
    }

    fn rig(
        &self,
        topics: &Topics,
        infos: &[CameraInfo; 2],
        tree: &Tree,
        frames: &[String; 2],
        rectified: bool,
    ) -> Result<StereoRig, Fault> {
        let fault = |side: usize, what: String| Fault::new(what, self.path).value(&topics.infos[side]);
        if let Some(side) = infos.iter().position(ros::is_uncalibrated) {
            let remedy = "calibrate it, and record the camera_info that the calibration gives to the driver";
            return Err(fault(side, "a camera that is not calibrated: K and P are zero".to_owned()).remedy(remedy));
        }
        let camera = |side: usize| ros::camera(&infos[side], rectified).map_err(|what| fault(side, what));
        let calibrated = ros::right_from_left(&infos[0], &infos[1], rectified).map_err(|what| fault(1, what))?;
        let [left, right] = frames;
        let stamp = infos[0].header.stamp_ns;
        // Some drivers name one frame for both images; the transform between the cameras is then unknown.
        let of_tree = (left != right).then(|| tree.look_up(right, left, stamp, self.settings.gap_ns())).flatten();
        if let (Some(_), Some(stands)) = (&calibrated, &of_tree) {
            let text = ros::contradiction(&infos[0], &infos[1], stands).map_err(|what| fault(1, what))?;
            if let Some(text) = text {
                let what = "P and the transforms give different poses of the cameras".to_owned();
                let remedy = format!(
                    "correct {} or the transform `{right}` from `{left}`; without the transform, P is used alone",
                    topics.infos[1]
                );
                return Err(fault(1, what).value(text).remedy(remedy));
            }
        }
        let stands = calibrated.or(of_tree).ok_or_else(|| {
            let remedy =
                format!("give the right camera's P a baseline (P[3] = −fx·b), or a transform `{left}` → `{right}`");
            fault(1, "no baseline".to_owned()).remedy(remedy)
        })?;
        StereoRig::new(camera(0)?, camera(1)?, stands).map_err(|error| fault(1, error.to_string()))
    }

    /// The poses of the left camera, with covariances if there are any. `said` is a topic of odometry, or `tf:FRAME`
    /// for the pose of the camera in that frame.
    pub(super) fn poses(&self, text: &str, tree: &Tree, camera: &str, stamps: &[u64]) -> Result<Poses, Fault> {
        let gap = self.settings.gap_ns();
        if text.is_empty() {
            return Ok((Vec::new(), None));
        }
        if let Some(frame) = text.strip_prefix("tf:") {
            let poses: Vec<_> =
                stamps.iter().filter_map(|&stamp| Some((stamp, tree.look_up(frame, camera, stamp, gap)?))).collect();
            if poses.is_empty() {
                let fault = Fault::new("no transform to the frame of the poses", self.path)
                    .value(format!("`{frame}` from `{camera}`"));
                return Err(fault.remedy("check the name of the frame"));
            }
            return Ok((poses, None));
        }
        let (mut poses, mut covariances) = (Vec::new(), Vec::new());
        for entry in self.of(text) {
            let kind = ros::plain(&self.recording.topics()[entry.topic].schema);
            let message = self.read(entry, |bytes| ros::PoseMessage::decode(bytes, &kind))?;
            let recorded = self.settings.stamps == Stamps::Log;
            let stamp_ns = if recorded { entry.log_time } else { message.header.stamp_ns };
            let child = if message.child.is_empty() { &self.settings.pose_frame } else { &message.child };
            let child_from_camera: Transform<Child, Camera> = match child.trim_start_matches('/') {
                "" => Transform::identity(),
                child if child == camera.trim_start_matches('/') => Transform::identity(),
                child => tree.look_up(child, camera, stamp_ns, gap).ok_or_else(|| {
                    let fault = Fault::new("no transform from the camera to the vehicle", self.path);
                    fault.value(format!("`{child}` from `{camera}`")).remedy("record /tf_static")
                })?,
            };
            let world_from_child: Transform<World, Child> = message.pose.transform();
            poses.push((stamp_ns, world_from_child * child_from_camera));
            covariances
                .push(message.covariance.and_then(|given| ros::covariance(&message.pose, &given, &child_from_camera)));
        }
        self.all_set(text, poses.iter().map(|pose| pose.0))?;
        if poses.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
            return Err(Fault::new("stamps that do not increase", self.path).value(text));
        }
        if poses.is_empty() {
            return Err(Fault::new("a topic without messages", self.path).value(text));
        }
        Ok((poses, covariances.into_iter().collect()))
    }
}
