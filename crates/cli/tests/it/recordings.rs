//! Recordings of ROS 2: supported messages and rejected files.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::{Path, PathBuf},
};

use mcap::{WriteOptions, records::MessageHeader};
use tempfile::TempDir;

use crate::program;

fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample")
}

/// Common Data Representation, little-endian: numbers are aligned to multiples of their size.
struct Cdr(Vec<u8>);

impl Cdr {
    /// A message that starts with a header.
    fn new(stamp_ns: u64, frame: &str) -> Self {
        Self(vec![0, 1, 0, 0]).header(stamp_ns, frame)
    }

    fn put(mut self, size: usize, bytes: &[u8]) -> Self {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
        self.0.extend(bytes);
        self
    }

    fn u32(self, number: u32) -> Self {
        self.put(4, &number.to_le_bytes())
    }

    fn f64s(self, numbers: &[f64]) -> Self {
        numbers.iter().fold(self, |cdr, number| cdr.put(8, &number.to_le_bytes()))
    }

    fn text(self, text: &str) -> Self {
        self.u32(text.len() as u32 + 1).put(1, text.as_bytes()).put(1, &[0])
    }

    fn header(self, stamp_ns: u64, frame: &str) -> Self {
        self.u32((stamp_ns / 1_000_000_000) as u32).u32((stamp_ns % 1_000_000_000) as u32).text(frame)
    }
}

/// A stereo recording that tests change before it is written.
struct Bag {
    /// Columns and rows of the images; the principal point is their centre.
    size: [u32; 2],
    /// Left and right images of each pair (PNG).
    images: Vec<[Vec<u8>; 2]>,
    /// Whether the topics' names call the images rectified.
    rectified: bool,
    model: &'static str,
    d: Vec<f64>,
    /// P[1] of both cameras, which is 0 for rectified ones.
    skew: f64,
    /// P[0] and P[3] of the two cameras at each pair.
    p: Vec<[[f64; 2]; 2]>,
    /// The baseline of /tf_static (m), the frame of the right camera in that of the left.
    tf: Option<[f64; 3]>,
    /// Poses of the left camera in the world: tx ty tz qx qy qz qw.
    poses: Vec<[f64; 7]>,
}

/// Writes the sample as a recording of ROS 2.
pub(crate) fn sample_recording(file: &Path) {
    fs::copy(Bag::sound().write().path().join("bag.mcap"), file).unwrap();
}

/// Writes image pairs as a recording of ROS 2, ten a second; the images have this size, the rig this focal length (px)
/// and baseline (m).
pub(crate) fn recording_of(images: Vec<[Vec<u8>; 2]>, size: [u32; 2], focal: f64, baseline: f64, file: &Path) {
    let bag = Bag {
        size,
        p: vec![[[focal, 0.0], [focal, -focal * baseline]]; images.len()],
        tf: Some([baseline, 0.0, 0.0]),
        poses: vec![[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]; images.len()],
        images,
        ..Bag::sound()
    };
    fs::copy(bag.write().path().join("bag.mcap"), file).unwrap();
}

const START_NS: u64 = 1_700_000_000_000_000_000;
const IMAGE: &str = "std_msgs/Header header\nstring format\nuint8[] data\n";
const INFO: &str = "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
                    float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n";
const ODOMETRY: &str = "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
                        geometry_msgs/TwistWithCovariance twist\n";
const TF: &str = "geometry_msgs/TransformStamped[] transforms\n";

impl Bag {
    /// The sample: five rectified pairs with their truth.
    fn sound() -> Self {
        let pair =
            |k: usize| ["left", "right"].map(|side| fs::read(sample().join(format!("{side}{k:03}.png"))).unwrap());
        let truth = fs::read_to_string(sample().join("truth.tum")).unwrap();
        let poses = truth.lines().filter(|line| !line.starts_with('#')).map(|line| {
            let numbers: Vec<f64> = line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
            numbers.try_into().unwrap()
        });
        Self {
            size: [1024, 768],
            images: (0..5).map(pair).collect(),
            rectified: true,
            model: "plumb_bob",
            d: vec![0.0; 4],
            skew: 0.0,
            p: vec![[[500.0, 0.0], [500.0, -125.0]]; 5],
            tf: Some([0.25, 0.0, 0.0]),
            poses: poses.collect(),
        }
    }

    /// Writes the recording and an experiment into a folder.
    fn write(&self) -> TempDir {
        let folder = TempDir::new().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::copy(sample().join("site.toml"), at("site.toml")).unwrap();
        let experiment = "question = 'Where?'\n[source]\nname = 'mcap'\npath = 'bag.mcap'\nsite = 'site.toml'\n\
                          prior = '/odom'\nprior-position = 0.1\nprior-attitude-deg = 0.5\ntruth = '/odom'\nmax-gap = 0.0\n";
        fs::write(at("e.toml"), experiment).unwrap();
        let mut mcap = WriteOptions::new().create(File::create(at("bag.mcap")).unwrap()).unwrap();
        let mut channel = |topic: &str, kind: &str, definition: &str| {
            let schema = mcap.add_schema(kind, "ros2msg", definition.as_bytes()).unwrap();
            mcap.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
        };
        let view = if self.rectified { "image_rect" } else { "image_raw" };
        let image = ["left", "right"]
            .map(|side| channel(&format!("/cam/{side}/{view}/compressed"), "sensor_msgs/msg/CompressedImage", IMAGE));
        let info = ["left", "right"]
            .map(|side| channel(&format!("/cam/{side}/camera_info"), "sensor_msgs/msg/CameraInfo", INFO));
        let odom = channel("/odom", "nav_msgs/msg/Odometry", ODOMETRY);
        let tf = channel("/tf_static", "tf2_msgs/msg/TFMessage", TF);
        let mut put = |channel_id: u16, log_time: u64, message: Cdr| {
            let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            mcap.write_to_known_channel(&header, &message.0).unwrap();
        };
        if let Some([x, y, z]) = self.tf {
            let one = Cdr(vec![0, 1, 0, 0]).u32(1).header(START_NS, "left").text("right");
            put(tf, START_NS, one.f64s(&[x, y, z, 0.0, 0.0, 0.0, 1.0]));
        }
        for (k, pair) in self.images.iter().enumerate() {
            let stamp = START_NS + k as u64 * 100_000_000;
            for side in [0, 1] {
                let frame = ["left", "right"][side];
                let [fx, tx] = self.p[k][side];
                let eye = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
                let [width, height] = self.size;
                let [cx, cy] = self.size.map(|pixels| f64::from(pixels - 1) / 2.0);
                let matrix = [fx, 0.0, cx, 0.0, fx, cy, 0.0, 0.0, 1.0];
                let p = [fx, self.skew, cx, tx, 0.0, fx, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
                let message = Cdr::new(stamp, frame).u32(height).u32(width).text(self.model);
                let message = message.u32(self.d.len() as u32).f64s(&self.d);
                let message = message.f64s(&matrix).f64s(&eye).f64s(&p);
                put(info[side], stamp, (0..6).fold(message, |message, _| message.u32(0)).put(1, &[0]));
                let data = &pair[side];
                put(image[side], stamp, Cdr::new(stamp, frame).text("png").u32(data.len() as u32).put(1, data));
            }
            let message = Cdr::new(stamp, "world").text("left").f64s(&self.poses[k]).f64s(&[0.0; 36]).f64s(&[0.0; 42]);
            put(odom, stamp, message);
        }
        mcap.finish().unwrap();
        folder
    }

    /// Exit code and standard output of `seafix check`.
    fn checked(&self) -> (i32, String) {
        let folder = self.write();
        let output = seafix(folder.path(), &["check", "bag.mcap"]);
        (output.status.code().unwrap(), String::from_utf8(output.stdout).unwrap())
    }

    /// Both `check` and `run` must report all of `parts` in a line and write nothing.
    fn rejected(&self, parts: &[&str]) {
        let folder = self.write();
        let check = seafix(folder.path(), &["check", "bag.mcap"]);
        let run = seafix(folder.path(), &["run", "e.toml", "--out", "out"]);
        assert_eq!((check.status.code(), run.status.code()), (Some(1), Some(3)));
        for said in [check.stdout, run.stderr] {
            let said = String::from_utf8(said).unwrap();
            assert!(said.lines().count() == 1 && parts.iter().all(|part| said.contains(part)), "{parts:?}: {said}");
        }
        assert!(!folder.path().join("out").exists());
    }
}

fn seafix(folder: &Path, arguments: &[&str]) -> std::process::Output {
    program().current_dir(folder).args(arguments).output().unwrap()
}

/// The number of frames, the number of frames with a fix, and the warnings of the manifest.
fn ran(folder: &Path) -> (usize, usize, Vec<String>) {
    let output = seafix(folder, &["run", "e.toml", "--out", "out"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = fs::read_to_string(folder.join("out/results.csv")).unwrap();
    let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heads = rows.next().unwrap();
    let of = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let (frame, outcome, wrong) = (of("frame"), of("outcome"), of("wrong"));
    let rows: Vec<Vec<&str>> = rows.collect();
    assert!(rows.iter().all(|row| row[wrong] != "true"), "{table}");
    let frames = |keep: &dyn Fn(&[&str]) -> bool| {
        let kept = rows.iter().filter(|row| keep(row)).map(|row| row[frame].to_owned());
        kept.collect::<std::collections::BTreeSet<String>>().len()
    };
    let (all, fixed) = (frames(&|_| true), frames(&|row| row[outcome] == "fix"));
    let manifest = fs::read(folder.join("out/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    let warnings = manifest["inputs"][0]["warnings"].as_array().unwrap();
    (all, fixed, warnings.iter().map(|warning| warning.as_str().unwrap().to_owned()).collect())
}

#[test]
fn a_sound_recording_is_reported_and_run() {
    let bag = Bag::sound();
    let (code, said) = bag.checked();
    assert_eq!(code, 0, "{said}");
    for part in [
        "note: 5 pairs of 1024×768",
        "/cam/left/image_rect/compressed",
        "over 0.4 s",
        "baseline 0.2500 m",
        "`/odom`",
        "in order",
    ] {
        assert!(said.contains(part), "no `{part}` in {said}");
    }
    let folder = bag.write();
    let (frames, fixed, warnings) = ran(folder.path());
    assert!(frames == 5 && fixed >= 3 && warnings.is_empty(), "{frames} {fixed} {warnings:?}");
    let (code, said) = Bag { tf: None, ..Bag::sound() }.checked();
    assert_eq!(code, 0, "{said}");
}

#[test]
fn baselines_that_contradict_each_other() {
    let with = |tf: [f64; 3]| Bag { tf: Some(tf), ..Bag::sound() };
    let parts = ["P and the transforms give different poses", "P gives 0.2500 m at [-0.250, 0.000, 0.000]"];
    with([0.5, 0.0, 0.0]).rejected(
        &[&parts[..], &["/tf 0.5000 m", "`right` from `left`", "correct /cam/right/camera_info or the transform"]]
            .concat(),
    );
    with([-0.25, 0.0, 0.0]).rejected(&[&parts[..], &["/tf 0.2500 m at [0.250"]].concat());
    with([0.0, 0.25, 0.0]).rejected(&[&parts[..], &["/tf 0.2500 m at [0.000, -0.250"]].concat());
    with([0.2532, 0.0, 0.0]).rejected(&parts);
    // A drawing is not a calibration.
    assert_eq!(with([0.2518, 0.01, 0.0]).checked().0, 0);
    // One of them alone contradicts nothing.
    let mut silent = with([0.25, 0.0, 0.0]);
    silent.p = vec![[[500.0, 0.0]; 2]; 5];
    let (code, said) = silent.checked();
    assert!(code == 0 && said.contains("baseline 0.2500 m"), "{said}");
    silent.tf = None;
    silent.rejected(&["no baseline", "P[3]"]);
}

/// The images are those of a pinhole: K and P agree, but a lens model r = f·θ does not.
#[test]
fn a_fisheye_lens_is_decided_by_the_pixels() {
    for (model, rectified) in [("equidistant", true), ("fisheye", false)] {
        let (code, said) = Bag { model, rectified, ..Bag::sound() }.checked();
        assert!(code == 0 && said.contains("taken as rectified ("), "{said}");
    }
    let bag = Bag { model: "double_sphere", ..Bag::sound() };
    bag.rejected(&[
        "the distortion model `double_sphere` is not supported",
        "/cam/left/camera_info",
        "rectify the images",
    ]);
    let (code, said) = Bag { rectified: false, ..Bag::sound() }.checked();
    assert!(code == 0 && said.contains("rectified: K without distortion is P"), "{said}");
}

/// Drivers of images without distortion state `none` or nothing, with zeros or without numbers; coefficients of no model
/// have no meaning. Fails if they are taken for plumb_bob.
#[test]
fn a_camera_without_a_distortion_model() {
    for (model, d) in [("none", vec![]), ("", vec![]), ("none", vec![0.0; 5]), ("", vec![0.0; 8])] {
        let (code, said) = Bag { model, d, rectified: false, ..Bag::sound() }.checked();
        assert!(code == 0 && said.contains("rectified: K without distortion is P"), "{said}");
    }
    let bag = Bag { model: "none", d: vec![-0.2, 0.05, 0.0, 0.0, 0.0], ..Bag::sound() };
    bag.rejected(&["the distortion model is `none`, but D has 5 numbers", "/cam/left/camera_info"]);
}

/// Some drivers publish K [R | t] of the mounted camera as P, others the baseline as P[3]. Fails if only the places of fx, cx
/// and tx are read.
#[test]
fn a_projection_that_is_not_of_rectified_images() {
    let bag = Bag { skew: 52.4, tf: None, ..Bag::sound() };
    bag.rejected(&["P is not of the form K [I | t]", "/cam/right/camera_info", "publish P of rectified cameras"]);
    let bag = Bag { p: vec![[[500.0, 0.0], [500.0, -0.25]]; 5], tf: None, ..Bag::sound() };
    bag.rejected(&["units? a baseline of 0.0005 m", "P[3] of ROS is −fx·baseline"]);
}

#[test]
fn a_camera_that_nobody_calibrated() {
    let bag = Bag { p: vec![[[0.0; 2]; 2]; 5], ..Bag::sound() };
    bag.rejected(&["a camera that is not calibrated: K and P are zero", "/cam/left/camera_info", "calibrate it"]);
}

#[test]
fn cameras_that_have_changed_places() {
    let mut bag = Bag::sound();
    bag.images.iter_mut().for_each(|pair| pair.reverse());
    bag.rejected(&["exchanged left and right images", "lie behind the cameras", "`left-info`"]);
    // With calibrations exchanged too they are a valid rig, which is reported.
    bag.p.iter_mut().for_each(|p| p.reverse());
    bag.tf = Some([-0.25, 0.0, 0.0]);
    let (code, said) = bag.checked();
    assert!(code == 0 && said.contains("warning: a left camera to the right of the right camera"), "{said}");
    let mut bag = Bag::sound();
    bag.images[3][1] = bag.images[3][0].clone();
    bag.rejected(&["identical left and right images", "1 of 5 pairs", "one image twice has no depth"]);
}

#[test]
fn an_image_that_cannot_be_read_costs_its_pair() {
    let mut bag = Bag::sound();
    bag.images[1][1].truncate(5000);
    let folder = bag.write();
    let (frames, fixed, warnings) = ran(folder.path());
    assert!(frames == 4 && fixed >= 2, "{frames} {fixed}");
    assert!(
        matches!(&warnings[..], [one] if one.contains("/cam/right/image_rect/compressed at 1700000000100000000 ns") && one.contains("its pair is skipped")),
        "{warnings:?}"
    );
    let (code, said) = bag.checked();
    assert!(code == 0 && said.contains("warning: ") && said.contains("note: 4 pairs"), "{said}");
    bag.images[2][0].clear();
    bag.images[4][0] = b"no image".to_vec();
    bag.rejected(&["/cam/right/image_rect", "3 of 5 pairs are unreadable; at least half must be readable"]);
}

#[test]
fn a_calibration_that_changes() {
    let mut bag = Bag::sound();
    bag.p[3][0][0] = 501.0;
    bag.rejected(&[
        "a calibration that changes within the recording",
        "/cam/left/camera_info",
        "1700000000300000000 ns",
        "split the recording there",
    ]);
}

#[test]
fn a_pose_with_something_that_is_no_number() {
    for (place, what) in [(1, "position ["), (5, "quaternion [")] {
        let mut bag = Bag::sound();
        bag.poses[2][place] = f64::NAN;
        let folder = bag.write();
        let run = seafix(folder.path(), &["run", "e.toml", "--out", "out"]);
        let said = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(3), "{said}");
        assert!(
            said.contains("a pose with NaN in it") && said.contains(what) && said.contains("/odom message"),
            "{said}"
        );
    }
}

#[test]
fn a_recording_is_no_experiment() {
    let folder = Bag::sound().write();
    let said = |arguments: &[&str], code: i32| {
        let output = seafix(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code));
        String::from_utf8([output.stderr, output.stdout].concat()).unwrap()
    };
    for arguments in [&["run", "bag.mcap", "--dry-run"][..], &["run", "bag.mcap", "--out", "out"]] {
        let said = said(arguments, 2);
        assert!(said.contains("not an experiment in bag.mcap: an MCAP file; `seafix replay`"), "{said}");
    }
    fs::write(folder.path().join("bag.db3"), b"SQLite format 3\0 and so on").unwrap();
    assert!(said(&["check", "bag.db3"], 1).contains("ros2 bag convert"));
    let replayed = said(&["replay", "bag.mcap"], 3);
    assert!(replayed.contains("not a log of a Seafix trial"), "{replayed}");
    let replayed = said(&["replay", "."], 3);
    assert!(
        replayed.contains("a folder, not the log of a trial") && replayed.contains("for instance ./bag.mcap"),
        "{replayed}"
    );
}
