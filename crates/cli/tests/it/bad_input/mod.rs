//! Invalid input: one line with file, place and remedy, the right exit code, and no partial output.

mod data_sets;
mod dives;
mod experiments;
mod flags;
mod images;
mod problems;

use std::{fs, path::PathBuf};

use tempfile::TempDir;

use crate::program;

/// A small valid data set: two images of noise, a rig, a site of three points.
struct Sample {
    folder: TempDir,
}

const SITE: &str = r#"format = "seafix-site/1"
name = "three"
axes = "p1p3-x/p1p2xp1p3-z/zx-y"
site_frame = "box"

[[object]]
id = "box"
base = ["A", "B", "C"]
base_in_world = [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [2.0, 0.0, 0.0]]
survey_sigma = 0.01

[[object.point]]
id = "A"
at = [0.0, 0.0, 0.0]

[[object.point]]
id = "B"
at = [0.0, -1.0, 0.0]

[[object.point]]
id = "C"
at = [2.0, 0.0, 0.0]
"#;

const DATASET: &str = r#"format = "seafix-dataset/1"
name = "sample"
licence = "CC0-1.0"
frames = "frames.csv"
site = "site.toml"
prior = "prior.tum"
prior_sigma = { position = 0.1, attitude_deg = 0.5 }

[rig]
right_from_left = [[1.0, 0.0, 0.0, -0.25], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]

[rig.left]
size = [64, 48]
fx = 50.0
fy = 50.0
cx = 31.5
cy = 23.5

[rig.right]
size = [64, 48]
fx = 50.0
fy = 50.0
cx = 31.5
cy = 23.5
"#;

impl Sample {
    fn new() -> Self {
        let sample = Self { folder: TempDir::new().unwrap() };
        sample.put("dataset.toml", DATASET);
        sample.put("site.toml", SITE);
        sample.put("frames.csv", "stamp_ns,left,right\n1000000000,a.pgm,b.pgm\n");
        sample.put("prior.tum", "1.0 0 0 -3 0 0 0 1\n");
        sample.put("a.pgm", &pgm(64, 48)).put("b.pgm", &other(64, 48));
        sample
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, text: &str) -> &Self {
        fs::write(self.path(name), text).unwrap();
        self
    }

    /// Replaces `from` by `to` in the file `name`.
    fn change(&self, name: &str, from: &str, to: &str) -> &Self {
        let text = fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(from), "{name} has no {from}");
        self.put(name, &text.replace(from, to))
    }

    /// Runs the data set; it must fail with `code`, report every one of `parts`, and write nothing.
    fn rejected(&self, code: i32, parts: &[&str]) {
        let out = self.path("out");
        rejected(&["run", self.folder.path().to_str().unwrap(), "--out", out.to_str().unwrap()], code, parts);
        assert!(!out.exists(), "something was written");
    }
}

/// A uniform image in the text form of PGM.
fn pgm(width: usize, height: usize) -> String {
    let pixels: Vec<String> = (0..width * height).map(|i| ((i * 7919) % 251).to_string()).collect();
    format!("P2\n{width} {height}\n255\n{}\n", pixels.join("\n"))
}

/// Another image of noise.
fn other(width: usize, height: usize) -> String {
    let pixels: Vec<String> = (0..width * height).map(|i| ((i * i * 31 + i * 457) % 241).to_string()).collect();
    format!("P2\n{width} {height}\n255\n{}\n", pixels.join("\n"))
}

/// The command must fail with `code` and one line for each fault; together they contain every one of `parts`.
fn rejected(arguments: &[&str], code: i32, parts: &[&str]) {
    let output = program().args(arguments).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(message.lines().all(|line| line.starts_with("error: ")), "{message}");
    for part in parts {
        assert!(message.contains(part), "no `{part}` in {message}");
    }
}

fn experiment(text: &str) -> (TempDir, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap().to_owned();
    (folder, file)
}
