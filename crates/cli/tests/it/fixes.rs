//! `seafix fixes` and `seafix view`.

use std::fs;

use tempfile::TempDir;

use crate::{ended_with, program};

const EXPERIMENT: &str = "question = 'Which?'\nseed = 3\n[source]\nname = 'virtual-points'\nframes = 3\n\
                          [[vary]]\nkey = 'pipeline.solver'\nvalues = ['kabsch', 'horn']\n";

/// A folder with a run of two trials, `run`.
fn run() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("e.toml"), EXPERIMENT).unwrap();
    ended_with(0, program().current_dir(folder.path()).args(["run", "e.toml", "--out", "run"]));
    folder
}

/// Fails if a fix of the results is missing, or if two frames have one stamp in a trajectory.
#[test]
fn fixes_are_a_table_or_a_trajectory() {
    let folder = run();
    let fixes = |code, args: &[&str]| {
        let ended = ended_with(code, program().current_dir(folder.path()).arg("fixes").args(args));
        if code == 0 { ended.out } else { ended.error }
    };
    let results = fs::read_to_string(folder.path().join("run/results.csv")).unwrap();
    let found = results.lines().filter(|line| line.contains(",fix,")).count();
    let table = fixes(0, &["run"]);
    assert!(found > 2 && table.lines().count() == 1 + found, "{table}");
    assert!(table.starts_with("trial,frame,stamp_ns,object,tx,ty,tz,qx,qy,qz,qw,c00,c01"), "{table}");
    let several = fixes(3, &["run", "--format", "tum"]);
    assert!(several.contains("001-solver-kabsch, 002-solver-horn") && several.contains("--trial"), "{several}");
    let trajectory = fixes(0, &["run", "--format", "tum", "--trial", "001-solver-kabsch"]);
    let lines: Vec<&str> = trajectory.lines().filter(|line| !line.starts_with('#')).collect();
    assert!(!lines.is_empty() && lines.len() <= 3, "{trajectory}");
    assert!(lines.iter().all(|line| line.split(' ').count() == 8), "{trajectory}");
    assert_eq!(fixes(0, &["run/001-solver-kabsch.mcap", "--format", "tum"]), trajectory);
    // Poses in the world are those that `eval` compares with the truth of the log.
    fs::write(folder.path().join("trajectory.tum"), &trajectory).unwrap();
    let eval = ["eval", "run/001-solver-kabsch.mcap", "trajectory.tum", "--json"];
    let errors = ended_with(0, program().current_dir(folder.path()).args(eval)).out;
    let errors: serde_json::Value = serde_json::from_str(&errors).unwrap();
    assert!(errors["ape"]["rmse"].as_f64().unwrap() < 0.1, "{errors}");
    assert!(fixes(3, &["run", "--trial", "x"]).contains("no trial `x`"));
    assert!(fixes(3, &["nowhere"]).contains("no run and no log"));
}

/// Fails if one column per axis is missing from the results, or its values from the manifest.
#[test]
fn a_varied_setting_is_a_column_of_the_results() {
    let folder = run();
    let results = fs::read_to_string(folder.path().join("run/results.csv")).unwrap();
    let head = results.lines().next().unwrap();
    assert!(head.ends_with(",region,pipeline.solver"), "{head}");
    let ends: Vec<&str> = results.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert!(ends.iter().all(|end| ["kabsch", "horn"].contains(end)) && ends.contains(&"horn"), "{ends:?}");
    let manifest = fs::read_to_string(folder.path().join("run/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["trials"][1]["values"]["pipeline.solver"], "horn");
    assert_eq!(manifest["axes"][0]["column"], "pipeline.solver");
    assert!(manifest["axes"][0]["description"].as_str().unwrap().to_lowercase().contains("solver"), "{manifest}");
    // A replay is compared with its original as it is.
    let replay = ["replay", "run/001-solver-kabsch.mcap", "--solver", "mahalanobis", "--out", "again"];
    ended_with(0, program().current_dir(folder.path()).args(replay));
    let compared = program().current_dir(folder.path()).args(["compare", "run", "again"]).output().unwrap();
    let said = String::from_utf8_lossy(&compared.stdout).into_owned() + &String::from_utf8_lossy(&compared.stderr);
    assert!([Some(0), Some(1)].contains(&compared.status.code()) && said.contains("n 3"), "{said}");
}
