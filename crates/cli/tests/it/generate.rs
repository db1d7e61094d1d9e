//! `seafix generate`: generated problems are checked and solved like others; invalid arguments are rejected.

use std::{fs, path::Path};

use tempfile::TempDir;

use crate::{ended, program};

fn seafix(arguments: &[&str]) -> (Option<i32>, String, String) {
    let ended = ended(program().args(arguments));
    (ended.code, ended.out, ended.error)
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn problems_and_truth_are_written_and_sound() {
    let folder = TempDir::new().unwrap();
    let families = ["paper-scale", "site-scale", "no-prior", "putative", "lattice", "few-visible", "dense-clutter"];
    for (family, letter) in families.into_iter().zip(["a", "b", "c", "d", "e", "f", "g"]) {
        let out = folder.path().join(letter);
        let out_name = out.to_str().unwrap();
        let (code, message, error) =
            seafix(&["generate", family, "--seed", "3", "--count", "2", "--first", "1", "--out", out_name]);
        assert_eq!(code, Some(0), "{error}");
        assert!(message.starts_with("2 problems and their truth in "), "{message}");
        let expected: Vec<String> =
            (1..3).flat_map(|k| [".json", ".truth.json"].map(|end| format!("{letter}00{k}{end}"))).collect();
        assert_eq!(names(&out), expected);
        let problem = out.join(format!("{letter}001.json"));
        let (code, message, _) = seafix(&["check", problem.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{message}");
    }
    let solved = seafix(&["solve", "--json", folder.path().join("a/a002.json").to_str().unwrap()]);
    assert_eq!(solved.0, Some(0), "{}", solved.2);
}

#[test]
fn the_object_can_be_left_away() {
    let folder = TempDir::new().unwrap();
    for how in ["--absent", "--replaced"] {
        let out = folder.path().join(how);
        let (code, ..) = seafix(&["generate", "few-visible", how, "--out", out.to_str().unwrap()]);
        assert_eq!(code, Some(0));
        let truth = fs::read_to_string(out.join("f000.truth.json")).unwrap();
        assert!(truth.contains(r#""pairs":[],"pose_defined":false"#), "{truth}");
    }
}

#[test]
fn what_cannot_be_generated_is_rejected() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let out_name = out.to_str().unwrap();
    for (arguments, states) in [
        (&["generate", "h", "--out", out_name][..], "unknown family `h`"),
        (&["generate", "paper-scale", "--count", "0", "--out", out_name], "0 is not in 1..=1000000"),
        (&["generate", "paper-scale", "--count", "2000000", "--out", out_name], "2000000 is not in 1..=1000000"),
        (&["generate", "paper-scale", "--count", "1000000000", "--out", out_name], "1000000000 is not in 1..=1000000"),
        (&["generate", "paper-scale", "--first", "99999999999", "--out", out_name], "99999999999 is not in"),
        (&["generate", "paper-scale", "--seed", "-1", "--out", out_name], "unexpected argument '-1'"),
        (&["generate", "paper-scale", "--seed", "x", "--out", out_name], "invalid value 'x'"),
        (&["generate", "paper-scale"], "--out <OUT>"),
        (&["generate", "lattice", "--replaced", "--out", out_name], "no box to replace"),
        (&["generate", "paper-scale", "--absent", "--replaced", "--out", out_name], "cannot be used with"),
    ] {
        let (code, _, error) = seafix(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {error}");
        assert!(error.contains(states) && error.lines().count() == 1, "{error}");
        assert!(!out.exists(), "something was written");
    }
}

#[test]
fn a_folder_that_cannot_be_filled_is_rejected() {
    let folder = TempDir::new().unwrap();
    let taken = folder.path().join("taken");
    fs::write(&taken, "a file").unwrap();
    let (code, _, error) = seafix(&["generate", "paper-scale", "--out", taken.to_str().unwrap()]);
    assert_eq!(code, Some(4), "{error}");
    let full = folder.path().join("full");
    fs::create_dir(&full).unwrap();
    fs::write(full.join("a000.json"), "mine").unwrap();
    let (code, _, error) = seafix(&["generate", "paper-scale", "--out", full.to_str().unwrap()]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("not empty") && error.lines().count() == 1, "{error}");
    assert_eq!(names(&full), ["a000.json"]);
}
