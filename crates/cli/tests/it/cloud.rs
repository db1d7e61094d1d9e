//! `seafix cloud`: from two images to a cloud, with output for people and for programs.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_data::dataset::write_png;
use seafix_io::{ImageLimits, read_image};
use serde_json::Value;
use tempfile::TempDir;

use crate::{Ended, ended, ended_with, program};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample").join(name)
}

/// The command for the first stereo pair of the sample, with further arguments.
fn cloud(more: &[&str], code: i32) -> Ended {
    let table = fs::read_to_string(sample("frames.csv")).unwrap();
    let pair: Vec<&str> = table.lines().nth(1).unwrap().split(',').skip(1).collect();
    let mut command = program();
    command.arg("cloud").args(pair.iter().map(|name| sample(name)));
    ended_with(code, command.arg("--rig").arg(sample("dataset.toml")).args(more))
}

fn json(more: &[&str]) -> Value {
    serde_json::from_str(&cloud(&[&["--json"], more].concat(), 0).out).unwrap()
}

/// The error of a command that ends with this code and prints nothing.
fn rejection(more: &[&str], code: i32) -> String {
    let ended = cloud(more, code);
    assert!(ended.out.is_empty() && ended.error.lines().count() == 1, "{}", ended.error);
    ended.error
}

#[test]
fn a_program_gets_every_point_and_the_times() {
    let all = json(&["--repeat", "2"]);
    let points = all["points"].as_array().unwrap();
    assert!(points.len() > 100);
    for point in points {
        let (position, covariance) = (&point["position"], &point["covariance"]);
        assert!(position[2].as_f64().unwrap() > 0.0);
        assert!((0..3).all(|i| covariance[i][i].as_f64().unwrap() > 0.0));
        // The rig of the sample is rectified: the two rows agree within noise.
        let row = |side: &str| point[side][1].as_f64().unwrap();
        assert!((row("left") - row("right")).abs() < 3.0, "{point}");
    }
    for stage in ["filter", "detect", "describe", "match", "refine", "triangulate", "total"] {
        let times = &all["times_ms"][stage];
        let (min, median) = (times["min"].as_f64().unwrap(), times["median"].as_f64().unwrap());
        assert!(0.0 <= min && min <= median, "{stage}: {times}");
    }
}

#[test]
fn threads_and_repeats_change_no_point() {
    let points = |more: &[&str]| json(more)["points"].clone();
    assert_eq!(points(&["--threads", "3", "--repeat", "3"]), points(&[]));
}

/// As in a run, corners without a key point follow the points of key points, of which they may replace some.
///
/// Fails if the cloud is that of the front end alone.
#[test]
fn the_cloud_is_that_of_the_pipeline() {
    let points = |more: &[&str]| json(more)["points"].as_array().unwrap().clone();
    let without = ["--set", "outline-corners.enabled=false", "--set", "edge-corners.enabled=false"];
    let (all, of_key_points) = (points(&[]), points(&without));
    let corners = all.iter().filter(|point| !of_key_points.contains(point)).count();
    assert!(corners > 0 && all.len() <= of_key_points.len() + corners, "{} and {}", all.len(), of_key_points.len());
    assert!(all[all.len() - corners..].iter().all(|point| !of_key_points.contains(point)));
    let counts = format!("{} points, {corners} of them corners", all.len());
    let message = cloud(&[], 0).out;
    assert!(message.contains(&counts), "{message}: {counts}");
}

#[test]
fn the_budget_is_kept() {
    let all = json(&["--features", "50"]);
    assert_eq!(all["keypoints"], serde_json::json!([50, 50]));
    assert_eq!(all["pipeline"]["detector"]["features"], 50);
}

#[test]
fn refinement_and_triangulation_are_chosen_by_name() {
    let chosen = json(&["--set", "refinement=none", "--set", "triangulator=midpoint"]);
    let name = |all: &Value, stage: &str| all["pipeline"][stage]["name"].as_str().unwrap().to_owned();
    assert_eq!(
        (name(&chosen, "refinement"), name(&chosen, "triangulator")),
        ("none".to_owned(), "midpoint".to_owned())
    );
    assert!(chosen["points"].as_array().unwrap().len() > 100);
    let set = json(&["--set", "refinement.window=15", "--set", "triangulator.max-depth=9"]);
    assert_eq!((name(&set, "refinement"), name(&set, "triangulator")), ("direct".to_owned(), "optimal".to_owned()));
    assert_eq!(
        (&set["pipeline"]["refinement"]["window"], &set["pipeline"]["triangulator"]["max-depth"]),
        (&15.into(), &9.into())
    );
    assert!(
        rejection(&["--set", "refinement=dirct"], 2)
            .contains("no refinement is called `dirct`, did you mean `direct`?")
    );
}

#[test]
fn the_complete_cloud_is_written() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("cloud.ply");
    let message = cloud(&["--out", file.to_str().unwrap()], 0).out;
    let bytes = fs::read(&file).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let count: usize = header.split("element vertex ").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    assert_eq!(bytes.len() - end, count * (3 * 8 + 3 + 4));
    assert!(message.contains(&format!("{count} points")), "{message}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no partial file stays");
}

#[test]
fn images_that_changed_places_are_rejected() {
    let mut command = program();
    let table = fs::read_to_string(sample("frames.csv")).unwrap();
    let pair: Vec<&str> = table.lines().nth(1).unwrap().split(',').skip(1).collect();
    command.arg("cloud").args([sample(pair[1]), sample(pair[0])]).arg("--rig").arg(sample("dataset.toml"));
    let message = ended_with(3, &mut command).error;
    assert!(message.contains("exchanged left and right images") && message.lines().count() == 1, "{message}");
}

/// The standard error of `cloud` for two of the sample's images with a changed rig.
fn message(images: [&str; 2], rig: impl Fn(String) -> String, code: i32) -> String {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("dataset.toml");
    fs::write(&file, rig(fs::read_to_string(sample("dataset.toml")).unwrap())).unwrap();
    let mut command = program();
    ended_with(code, command.arg("cloud").args(images.map(sample)).arg("--rig").arg(&file)).error
}

/// Seen to fail when the two images are not compared: there were 17 points.
#[test]
fn one_image_twice_is_rejected() {
    let message = message(["left000.png", "left000.png"], |rig| rig, 3);
    assert!(message.contains("identical left and right images") && message.lines().count() == 1, "{message}");
}

/// A wrong rig is detected by the epipolar distances of its images, a rig falsely marked as rectified by its
/// parameters.
#[test]
fn rows_that_do_not_correspond_are_reported() {
    let images = ["left000.png", "right000.png"];
    assert_eq!(message(images, |rig| rig, 0), "");
    // The right camera points 20 rows lower than its calibration.
    let lower = |rig: String| {
        let (left, right) = rig.split_once("[rig.right]").unwrap();
        format!("{left}[rig.right]{}", right.replace("cy = 383.5", "cy = 403.5"))
    };
    let reported = message(images, lower, 0);
    assert!(reported.contains("warning: a rig marked as rectified that is not in "), "{reported}");
    // The same, with a calibration of equal rows.
    let upright =
        |rig: String| rig.replace("-0.25]", "0.0]").replacen("0.0, 1.0, 0.0, 0.0]", "0.0, 1.0, 0.0, -0.25]", 1);
    let reported = message(images, upright, 0);
    let parts =
        ["the images contradict the rig in ", "are within 3 px of the same columns, RMS ", " px; give the calibration"];
    assert!(parts.iter().all(|part| reported.contains(part)), "{reported}");
}

#[test]
fn key_points_that_come_to_nothing_are_reported() {
    let images = [sample("right000.png"), sample("left000.png")];
    let run = |images: &[PathBuf; 2]| {
        let mut command = program();
        // Too few corners for the swap check.
        ended(command.arg("cloud").args(images).arg("--rig").arg(sample("dataset.toml"))).error
    };
    assert!(run(&images).contains("exchanged left and right"));
    let folder = TempDir::new().unwrap();
    let few = images.map(|image| {
        // The image is dark except for a small part.
        let name = folder.path().join(image.file_name().unwrap());
        let mut grey = read_image(&image, [1024, 768], 16, ImageLimits::default()).unwrap();
        let seen = |i: usize| (400..560).contains(&(i % 1024)) && (330..400).contains(&(i / 1024));
        grey.pixels_mut().iter_mut().enumerate().filter(|(i, _)| !seen(*i)).for_each(|(_, pixel)| *pixel = 40.0);
        write_png(&name, &grey, 8).unwrap();
        name
    });
    let reported = run(&few);
    let parts = [
        "warning: key points, but no triangulated point in ",
        "with left and right exchanged ",
        "; exchange the left and right images if",
    ];
    assert!(parts.iter().all(|part| reported.contains(part)), "{reported}");
}

#[test]
fn what_cannot_be_is_rejected_in_one_line() {
    assert!(rejection(&["--detector", "haris"], 2).contains("did you mean `harris`?"));
    assert!(rejection(&["--features", "0"], 2).contains("features"));
    assert!(rejection(&["--set", "detector.sigmma=2"], 2).contains("did you mean `sigma`?"));
    assert!(rejection(&["--out", "/nowhere/cloud.ply"], 4).contains("/nowhere/cloud.ply"));
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("dataset.toml");
    let text = fs::read_to_string(sample("dataset.toml")).unwrap();
    let rejected = |text: &str| {
        fs::write(&rig, text).unwrap();
        let mut command = program();
        let image = sample("frames.csv");
        ended_with(3, command.arg("cloud").args([&image, &image]).arg("--rig").arg(&rig)).error
    };
    assert!(rejected(&text).contains("an image that cannot be decoded"));
    assert!(rejected(&text.replace("fx = ", "fx = -")).contains("dataset.toml:"));
}

/// The first pair of a recording, of a data set and of a log has the cloud of its two images.
#[test]
fn a_recording_has_the_clouds_of_its_images() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    crate::recordings::sample_recording(&bag);
    let points = |arguments: &[&str]| {
        let ended = ended_with(0, program().arg("cloud").args(arguments).arg("--json"));
        let all: Value = serde_json::from_str(&ended.out).unwrap();
        all["points"].clone()
    };
    let (sample, bag) = (sample(""), bag.to_str().unwrap());
    let sample = sample.to_str().unwrap();
    for pair in ["0", "3"] {
        let of_dataset = points(&[sample, "--pair", pair]);
        assert!(of_dataset.as_array().unwrap().len() > 8);
        assert_eq!(points(&[bag, "--pair", pair]), of_dataset);
    }
    assert_eq!(points(&[bag]), json(&[])["points"]);
    let rejected = |arguments: &[&str], code: i32| ended_with(code, program().arg("cloud").args(arguments)).error;
    let said = rejected(&[bag, "--pair", "5"], 2);
    assert!(said.lines().count() == 1 && said.contains("--pair is from 0 to 4"), "{said}");
    let image = format!("{sample}/left000.png");
    let said = rejected(&[&image], 2);
    assert!(said.lines().count() == 1 && said.contains("one image without the other"), "{said}");
}
