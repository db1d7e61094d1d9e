//! A model by hand, as a person asks for it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use assert_cmd::{Command, assert::Assert};
use tempfile::TempDir;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample").join(name)
}

/// Four corners of the third pair, to a pixel or so; the right places are sought.
const CLICKS: &str = "id,left_u,left_v,right_u,right_v\nA,{A}\nB,{B}\nC,{C}\nD,{D}\n";

/// The marks, with the places of four corners that the cloud of the pair has.
fn clicks() -> String {
    let mut command = Command::cargo_bin("seafix").unwrap();
    command.args(["cloud", "--json", "--rig"]).arg(sample("dataset.toml"));
    let said = command.args([sample("left002.png"), sample("right002.png")]).assert().success();
    let cloud: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
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

fn model(folder: &Path, marks: &str, more: &[&str]) -> Assert {
    fs::write(folder.join("clicks.csv"), marks).unwrap();
    let mut command = Command::cargo_bin("seafix").unwrap();
    command.current_dir(folder).arg("model").args([sample("left002.png"), sample("right002.png")]);
    command.arg("--rig").arg(sample("dataset.toml")).args(["--points", "clicks.csv"]).args(more).assert()
}

#[test]
fn a_model_is_a_site_that_check_takes() {
    let folder = TempDir::new().unwrap();
    let marks = clicks();
    let said = model(folder.path(), &marks, &["--id", "valve", "--base", "B,C,D", "--out", "valve.toml"]).success();
    let said = String::from_utf8(said.get_output().stdout.clone()).unwrap();
    assert!(said.ends_with("4 points; the frame is that of B, C, D\n"), "{said}");
    Command::cargo_bin("seafix").unwrap().arg("check").arg(folder.path().join("valve.toml")).assert().success();
    // Without a file the site is printed, and nothing else with it.
    let printed = model(folder.path(), &marks, &["--id", "valve", "--base", "B,C,D"]).success();
    assert_eq!(printed.get_output().stdout, fs::read(folder.path().join("valve.toml")).unwrap());
    let json = model(folder.path(), &marks, &["--json"]).success();
    let json: serde_json::Value = serde_json::from_slice(&json.get_output().stdout).unwrap();
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
        (&marks, &["--base", "A,B"], 2, "three ids, separated by commas"),
        (&marks, &["--base", "A,B,X"], 3, "a base point is not marked"),
        (&marks, &["--reach", "0"], 2, "--reach 0: more than 0"),
    ];
    for (marks, more, code, part) in cases {
        let ended = model(folder.path(), marks, &[more, &["--out", "site.toml"]].concat()).code(code);
        let text = String::from_utf8(ended.get_output().stderr.clone()).unwrap();
        assert!(text.lines().count() == 1 && text.contains(part), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "only the marks");
    }
    let ended = model(folder.path(), &marks, &["--out", "nowhere/site.toml"]).code(4);
    assert_eq!(String::from_utf8(ended.get_output().stderr.clone()).unwrap().lines().count(), 1);
}
