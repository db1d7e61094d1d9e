//! `seafix model`: a model from marked points.

use std::{
    fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use crate::{Ended, ended_with, program};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample").join(name)
}

/// Marks of four corners of the third pair, to a pixel or so; right coordinates are estimated.
const CLICKS: &str = "id,left_u,left_v,right_u,right_v\nA,{A}\nB,{B}\nC,{C}\nD,{D}\n";

/// The marks, and four corners at the same positions in the cloud of the pair.
fn clicks() -> String {
    let mut command = program();
    command.args(["cloud", "--json", "--rig"]).arg(sample("dataset.toml"));
    let cloud = ended_with(0, command.args([sample("left002.png"), sample("right002.png")])).out;
    let cloud: serde_json::Value = serde_json::from_str(&cloud).unwrap();
    let points = cloud["points"].as_array().unwrap();
    let place = |index: usize| {
        let [u, v] = [0, 1].map(|axis| points[index]["left"][axis].as_f64().unwrap());
        format!("{:.1},{:.1},,", u + 0.7, v - 0.6)
    };
    let apart = points.len() / 4;
    ["{A}", "{B}", "{C}", "{D}"]
        .iter()
        .enumerate()
        .fold(CLICKS.to_owned(), |text, (k, key)| text.replace(key, &place(k * apart + 7)))
}

fn model(folder: &Path, marks: &str, more: &[&str], code: i32) -> Ended {
    fs::write(folder.join("clicks.csv"), marks).unwrap();
    let mut command = program();
    command.current_dir(folder).arg("model").args([sample("left002.png"), sample("right002.png")]);
    ended_with(code, command.arg("--rig").arg(sample("dataset.toml")).args(["--points", "clicks.csv"]).args(more))
}

#[test]
fn a_model_is_a_site_that_check_takes() {
    let folder = TempDir::new().unwrap();
    let marks = clicks();
    let message = model(folder.path(), &marks, &["--id", "valve", "--base", "B,C,D", "--out", "valve.toml"], 0).out;
    assert!(message.ends_with("4 points; the object frame is that of B, C, D\n"), "{message}");
    ended_with(0, program().arg("check").arg(folder.path().join("valve.toml")));
    // Without --out the site alone is printed.
    let printed = model(folder.path(), &marks, &["--id", "valve", "--base", "B,C,D"], 0).out;
    assert_eq!(printed, fs::read_to_string(folder.path().join("valve.toml")).unwrap());
    let json = model(folder.path(), &marks, &["--json"], 0).out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(json["points"][0]["covariance"][2][2].as_f64().unwrap() > 0.0);
}

#[test]
fn what_is_wrong_is_one_line_and_leaves_no_file() {
    let folder = TempDir::new().unwrap();
    let marks = clicks();
    let outside = marks.replace("\nB,", "\nB,-20,5,,\nE,");
    let cases: [(&str, &[&str], i32, &str); 6] = [
        ("u,v\n", &[], 3, "the first line is `id,left_u,left_v,right_u,right_v`"),
        ("id,left_u,left_v,right_u,right_v\n", &[], 3, "too few marks for a model"),
        (&outside, &[], 3, "clicks.csv:3: `B` at -20, 5"),
        (&marks, &["--base", "A,B"], 2, "separate three ids by commas"),
        (&marks, &["--base", "A,B,X"], 3, "a base point is not marked"),
        (&marks, &["--reach", "0"], 2, "invalid --reach 0"),
    ];
    for (marks, more, code, part) in cases {
        let text = model(folder.path(), marks, &[more, &["--out", "site.toml"]].concat(), code).error;
        assert!(text.lines().count() == 1 && text.contains(part), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "only the marks");
    }
    let text = model(folder.path(), &marks, &["--out", "nowhere/site.toml"], 4).error;
    assert_eq!(text.lines().filter(|line| !line.starts_with("warning: ")).count(), 1, "{text}");
}
