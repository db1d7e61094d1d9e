//! The image and calibration topics of a recording.

use std::path::Path;

use seafix_component::{Fault, nearest};
use seafix_log::Topic;

use super::{mcap::Mcap, recordings::Recordings};
use crate::ros;

/// The topics of a stereo rig, left and right.
#[derive(Debug)]
pub(super) struct Topics {
    pub(super) images: [String; 2],
    pub(super) infos: [String; 2],
}

const IMAGES: [&str; 2] = ["sensor_msgs/Image", "sensor_msgs/CompressedImage"];
const INFOS: [&str; 1] = ["sensor_msgs/CameraInfo"];
const TRANSFORMS: [&str; 1] = ["tf2_msgs/TFMessage"];

/// The conversion of a ROS 1 bag. `mcap convert` keeps messages in the encoding of ROS 1.
const ROS_1: &str = "convert the ROS 1 bag itself: `pip install rosbags`, then `rosbags-convert --src IN.bag --dst OUT \
                     --dst-storage mcap --dst-typestore ros2_humble`, and give the folder OUT";

/// The words for the two cameras in topic names.
const SIDES: [[&str; 2]; 5] =
    [["left", "right"], ["cam0", "cam1"], ["camera0", "camera1"], ["infra1", "infra2"], ["port", "starboard"]];

impl Topics {
    /// The topics that the settings name, otherwise those recognised by name. Their schemas are supported.
    pub(super) fn of(path: &Path, recording: &Recordings, settings: &Mcap) -> Result<Self, Fault> {
        let find = Finder { path, topics: recording.topics() };
        let images = match [settings.left.as_str(), settings.right.as_str()] {
            ["", ""] => find.by_name()?,
            [left, right] => [find.called(left, "left", &IMAGES)?, find.called(right, "right", &IMAGES)?],
        };
        let info = |side: usize, message: &str, key: &str| match message {
            "" => find.called(&beside(&images[side].name), key, &INFOS),
            message => find.called(message, key, &INFOS),
        };
        let infos = [info(0, &settings.left_info, "left-info")?, info(1, &settings.right_info, "right-info")?];
        for (key, message) in [("prior", &settings.prior), ("truth", &settings.truth)] {
            if !message.is_empty() && !message.starts_with("tf:") {
                find.called(message, key, &ros::POSES)?;
            }
        }
        for name in ["/tf", "/tf_static"] {
            if find.topics.iter().any(|topic| topic.name == name) {
                find.called(name, name, &TRANSFORMS)?;
            }
        }
        Ok(Self { images: images.map(|topic| topic.name.clone()), infos: infos.map(|topic| topic.name.clone()) })
    }
}

/// The topic of an image's calibration: by ROS convention beside the image.
fn beside(image: &str) -> String {
    let image = image.strip_suffix("/compressed").unwrap_or(image);
    let folder = image.rsplit_once('/').map_or("", |(folder, _)| folder);
    format!("{folder}/camera_info")
}

struct Finder<'a> {
    path: &'a Path,
    topics: &'a [Topic],
}

impl<'a> Finder<'a> {
    /// The topic of this name with one of these types.
    fn called(&self, name: &str, key: &str, types: &[&str]) -> Result<&'a Topic, Fault> {
        let fitting = || self.topics.iter().filter(|topic| types.contains(&ros::plain(&topic.schema).as_str()));
        let Some(topic) = self.topics.iter().find(|topic| topic.name == name) else {
            let names: Vec<&str> = fitting().map(|topic| topic.name.as_str()).collect();
            let remedy = match nearest(name, names.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None if names.is_empty() => format!("it has none of type {}", types.join(" or ")),
                None => format!("set `{key}`; there are {}", names.join(", ")),
            };
            return Err(Fault::new("no such topic", self.path).value(format!("`{name}`")).remedy(remedy));
        };
        let kind = ros::plain(&topic.schema);
        let fault = |what: String| Fault::new(what, self.path).value(&topic.name);
        if !types.contains(&kind.as_str()) {
            return Err(fault(format!("a topic of type `{kind}`"))
                .remedy(format!("give a topic of type {}", types.join(" or "))));
        }
        if topic.encoding != "cdr" || !["ros2msg", "ros2idl"].contains(&topic.schema_encoding.as_str()) {
            let remedy = match topic.encoding.as_str() {
                "ros1" => ROS_1,
                _ => "only `cdr` with `ros2msg` or `ros2idl` is supported",
            };
            return Err(fault(format!("messages in `{}`, described in `{}`", topic.encoding, topic.schema_encoding))
                .remedy(remedy));
        }
        match ros::differs(&topic.schema, &topic.schema_encoding, &String::from_utf8_lossy(&topic.definition)) {
            Some(what) => Err(fault(what).remedy("give a bag with ROS 2 message definitions")),
            None => Ok(topic),
        }
    }

    /// The two image topics whose names identify left and right.
    fn by_name(&self) -> Result<[&'a Topic; 2], Fault> {
        let images: Vec<&Topic> =
            self.topics.iter().filter(|topic| IMAGES.contains(&ros::plain(&topic.schema).as_str())).collect();
        let called = |word: &str| images.iter().filter(|topic| topic.name.contains(word)).collect::<Vec<_>>();
        for [left, right] in SIDES {
            if let ([left], [right]) = (&called(left)[..], &called(right)[..]) {
                return Ok([self.called(&left.name, "left", &IMAGES)?, self.called(&right.name, "right", &IMAGES)?]);
            }
        }
        let names: Vec<&str> = images.iter().map(|topic| topic.name.as_str()).collect();
        let fault = Fault::new("ambiguous image topics of the left and the right camera", self.path);
        Err(fault.remedy(match names.is_empty() {
            true => "it has no topic of type sensor_msgs/Image or sensor_msgs/CompressedImage".to_owned(),
            false => format!("set `left` and `right`; there are {}", names.join(", ")),
        }))
    }
}
