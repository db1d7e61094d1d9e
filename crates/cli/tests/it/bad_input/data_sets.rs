//! Data sets: descriptions, rigs, sites, poses and paths.

use std::fs;

use super::{SITE, Sample, rejected};
use crate::{ended_with, program};

/// Each of these changes of the description is rejected with its own message.
fn each_rejected(changes: &[(&str, &str, &[&str])]) {
    for (from, to, parts) in changes {
        Sample::new().change("dataset.toml", from, to).rejected(3, &[&["dataset.toml:"], *parts].concat());
    }
}

#[test]
fn cameras_in_one_place() {
    each_rejected(&[
        ("-0.25]", "0.0]", &["baseline is 0.0e0 m"]),
        ("-0.25]", "-9e-7]", &["baseline is 9.0e-7 m"]),
        ("-0.25]", "nan]", &[]),
    ]);
}

#[test]
fn cameras_that_cannot_be() {
    let left = |numbers: &str| format!("[rig.left]\nsize = [64, 48]\n{numbers}\n\n[rig.right]");
    let sound = left("fx = 50.0\nfy = 50.0\ncx = 31.5\ncy = 23.5");
    for (numbers, parts) in [
        ("fx = 0.0\nfy = 50.0\ncx = 31.5\ncy = 23.5", ["dataset.toml:14: fx = 0; ", "positive number of pixels"]),
        ("fx = 50.0\nfy = -50.0\ncx = 31.5\ncy = 23.5", ["fy = -50", "positive number of pixels"]),
        ("fx = nan\nfy = 50.0\ncx = 31.5\ncy = 23.5", ["fx = NaN", "positive number of pixels"]),
        ("fx = 50.0\nfy = 50.0\ncx = 64.5\ncy = 23.5", ["cx = 64.5", "must lie in the image"]),
        ("fx = 50.0\nfy = 50.0\ncx = 31.5\ncy = -1.0", ["cy = -1", "must lie in the image"]),
    ] {
        each_rejected(&[(&sound, &left(numbers), &parts)]);
    }
    each_rejected(&[("[rig.left]\nsize = [64, 48]", "[rig.left]\nsize = [0, 48]", &["size = [0, 48]"])]);
}

#[test]
fn a_rig_that_is_no_rotation() {
    each_rejected(&[
        ("[[1.0, 0.0, 0.0, -0.25]", "[[1.1, 0.0, 0.0, -0.25]", &["orthonormal"]),
        ("[[1.0, 0.0, 0.0, -0.25]", "[[1.00001, 0.0, 0.0, -0.25]", &["orthonormal"]),
        ("[[1.0, 0.0, 0.0, -0.25]", "[[-1.0, 0.0, 0.0, -0.25]", &[]),
        ("[0.0, 0.0, 0.0, 1.0]]", "[0.0, 0.0, 0.5, 1.0]]", &[]),
    ]);
}

#[test]
fn a_quaternion_off_unit_length() {
    for q in ["0 0 0 0", "0 0 0 1.0011", "0 0 0 0.9989", "0 0 0 nan"] {
        Sample::new().put("prior.tum", &format!("1.0 0 0 -3 {q}\n")).rejected(3, &["prior.tum:1"]);
    }
    let sample = Sample::new();
    sample.put("prior.tum", "1.0 0 0 -3 0 0 0 1.0009\n");
    let check = program().arg("check").arg(sample.folder.path()).output().unwrap();
    let text = String::from_utf8(check.stdout).unwrap();
    assert_eq!(text.matches("it was normalised").count(), 1, "{text}");
}

#[test]
fn a_model_with_two_points() {
    let sample = Sample::new();
    let two = SITE.split("[[object.point]]\nid = \"C\"").next().unwrap();
    sample.put("site.toml", two).change("site.toml", "base = [\"A\", \"B\", \"C\"]", "base = [\"A\", \"B\", \"B\"]");
    let folder = sample.folder.path().to_str().unwrap();
    let output = program().args(["run", folder]).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.lines().any(|line| line.contains("site.toml:") && line.contains("2 ")), "{message}");
}

#[test]
fn a_collinear_base() {
    Sample::new()
        .change("site.toml", "at = [0.0, -1.0, 0.0]", "at = [1.0, 0.0, 0.0]")
        .change("site.toml", "[0.0, -1.0, 0.0]", "[1.0, 0.0, 0.0]")
        .rejected(3, &["site.toml:8", "collinear"]);
}

#[test]
fn a_coordinate_that_is_no_number() {
    Sample::new()
        .change("site.toml", "at = [2.0, 0.0, 0.0]", "at = [2.0, nan, 0.0]")
        .rejected(3, &["site.toml:", "C", "NaN"]);
}

#[test]
fn the_sound_sample_runs() {
    let sample = Sample::new();
    let out = sample.path("out");
    let run = ["run", sample.folder.path().to_str().unwrap(), "--out", out.to_str().unwrap()];
    ended_with(0, program().args(run));
    for file in ["001.mcap", "results.csv", "results.parquet", "manifest.json", "report/report.html"] {
        assert!(out.join(file).exists(), "{file}");
    }
    assert!(fs::read_dir(&out).unwrap().all(|entry| !entry.unwrap().path().to_string_lossy().ends_with(".partial")));
}

/// Seen to fail when lines are counted one too far.
#[test]
fn an_unknown_key_of_a_data_set() {
    Sample::new()
        .change("dataset.toml", "licence =", "license =")
        .rejected(3, &["dataset.toml:3", "`license`", "`licence`"]);
}

#[test]
fn a_missing_file() {
    Sample::new()
        .change("dataset.toml", "site.toml", "sight.toml")
        .rejected(3, &["dataset.toml:5", "sight.toml", "does not exist"]);
}

#[test]
fn a_path_that_leads_out() {
    Sample::new().change("frames.csv", "a.pgm,b.pgm", "../a.pgm,b.pgm").rejected(3, &["frames.csv:2", "leads out"]);
}

#[test]
fn an_output_folder_that_is_not_empty() {
    let sample = Sample::new();
    let folder = sample.folder.path().to_str().unwrap();
    rejected(&["run", folder, "--out", folder], 4, &["not empty", "--out"]);
}

#[test]
fn check_lists_everything_at_once() {
    let sample = Sample::new();
    sample
        .change(
            "dataset.toml",
            "fx = 50.0\nfy = 50.0\ncx = 31.5\ncy = 23.5\n\n[rig.right]",
            "fx = -1.0\nfy = 50.0\ncx = 31.5\ncy = 23.5\n\n[rig.right]",
        )
        .change("prior.tum", "0 0 0 1", "0 0 0 2")
        .change("frames.csv", "a.pgm,b.pgm", "c.pgm,a.pgm");
    let output = program().args(["check", sample.folder.path().to_str().unwrap()]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    for part in ["fx = -1", "prior.tum:1", "c.pgm"] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
}
