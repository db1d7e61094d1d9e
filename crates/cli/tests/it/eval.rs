//! `seafix eval`: errors of trajectories.

use std::{fs, path::Path};

use serde_json::Value;

use crate::{ended, ended_with, program};

fn eval(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let ended = ended(program().current_dir(folder).arg("eval").args(arguments));
    (ended.code.unwrap(), ended.out, ended.error)
}

fn walk(folder: &Path, name: &str, line: impl Fn(f64) -> String) {
    fs::write(folder.join(name), (0..50).map(|i| line(f64::from(i))).collect::<String>()).unwrap();
}

/// A helix, and the same with a scale error of one per cent.
fn walks() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let helix = |scale_error: f64| {
        move |t: f64| {
            let (x, y, z) =
                (scale_error * 3.0 * (0.2 * t).cos(), scale_error * 3.0 * (0.2 * t).sin(), scale_error * 0.3 * t);
            format!("{t} {x} {y} {z} 0 0 0 1\n")
        }
    };
    walk(folder.path(), "truth.tum", helix(1.0));
    walk(folder.path(), "odometry.tum", helix(1.01));
    folder
}

#[test]
fn a_scaled_walk_has_the_drift_of_its_scale_error() {
    let folder = walks();
    let (code, out, _) = eval(folder.path(), &["truth.tum", "odometry.tum", "--json"]);
    let value: Value = serde_json::from_str(&out).unwrap();
    let number = |pointer: &str| value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"));
    assert_eq!((code, number("/ape/pairs"), number("/rpe/pairs"), number("/matched/fraction")), (0, 50.0, 49.0, 1.0));
    let chord = (2.0 * 3.0 * 0.1_f64.sin()).hypot(0.3);
    assert!((number("/rpe/mean") - 0.01 * chord).abs() < 1e-12);
    assert!((number("/end_m") / number("/path_m")) < 0.01);
    let (_, out, _) = eval(folder.path(), &["truth.tum", "odometry.tum", "-a", "-s", "--json"]);
    let value: Value = serde_json::from_str(&out).unwrap();
    assert!(value["ape"]["rmse"].as_f64().unwrap() < 1e-12);
    assert!((value["alignment"]["scale"].as_f64().unwrap() * 1.01 - 1.0).abs() < 1e-12);
}

#[test]
fn people_see_what_matched() {
    let folder = walks();
    walk(folder.path(), "short.tum", |t| format!("{} 0 0 0 0 0 0 1\n", if t < 30.0 { t } else { t + 0.4 }));
    walk(folder.path(), "two.tum", |t| if t < 2.0 { format!("{t} 0 0 0 0 0 0 1\n") } else { String::new() });
    let (code, out, warned) = eval(folder.path(), &["truth.tum", "short.tum"]);
    assert_eq!(code, 0);
    assert!(out.contains("30 poses: 60.0 % of 50 in truth.tum") && out.contains("drift over"), "{out}");
    assert!(warned.contains("warning: only 30 poses matched"), "{warned}");
    let (_, _, warned) = eval(folder.path(), &["truth.tum", "two.tum"]);
    assert!(warned.starts_with("warning: two.tum covers 2.0 % of the time of truth.tum"), "{warned}");
}

#[test]
fn an_aligned_estimate_is_written_and_read_again() {
    let folder = walks();
    for file in ["aligned.tum", "aligned.kitti", "aligned.csv"] {
        let (code, ..) = eval(folder.path(), &["truth.tum", "odometry.tum", "-a", "-s", "--out", file]);
        let (again, out, _) = eval(folder.path(), &["truth.tum", file, "--json"]);
        let value: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((code, again), (0, 0), "{file}");
        assert!(value["ape"]["max"].as_f64().unwrap() < 1e-12, "{file}");
    }
}

#[test]
fn what_cannot_be_compared_is_rejected_in_one_line() {
    let folder = walks();
    walk(folder.path(), "later.tum", |t| format!("{} 0 0 0 0 0 0 1\n", t + 1e6));
    walk(folder.path(), "line.tum", |t| format!("{t} {t} 0 0 0 0 0 1\n"));
    walk(folder.path(), "short.tum", |t| if t < 2.0 { format!("{t} {t} 0 0 0 0 0 1\n") } else { String::new() });
    walk(folder.path(), "few.kitti", |t| if t < 9.0 { "1 0 0 0 0 1 0 0 0 0 1 0\n".into() } else { String::new() });
    walk(folder.path(), "seven.tum", |t| format!("{t} 0 0 0 0 0 1\n"));
    fs::write(folder.path().join("empty.tum"), "# nothing\n").unwrap();
    for (arguments, code, words) in [
        (&["truth.tum", "later.tum"][..], 3, "only 0 of 50 and 50 poses are associated"),
        (&["truth.tum", "line.tum", "-a"], 3, "a point or a line"),
        (&["truth.tum", "short.tum", "-a"], 3, "2 poses; an alignment needs at least 3"),
        (&["truth.tum", "few.kitti"], 3, "without stamps"),
        (&["truth.tum", "seven.tum"], 3, "7 columns in seven.tum:1"),
        (&["truth.tum", "empty.tum"], 3, "without poses in empty.tum"),
        (&["truth.tum", "nowhere.tum"], 3, "nowhere.tum"),
        (&["truth.tum", "odometry.tum", "-d", "1.5"], 2, "whole number of frames"),
        (&["truth.tum", "odometry.tum", "-d", "200", "-u", "d"], 2, "at most 180"),
        (&["truth.tum", "odometry.tum", "--out", "no/where.tum"], 4, "no/where.tum"),
    ] {
        let (found, out, error) = eval(folder.path(), arguments);
        assert_eq!(found, code, "{arguments:?}: {error}");
        assert!(error.starts_with("error: ") && error.contains(words) && error.lines().count() == 1, "{error}");
        assert!(out.is_empty(), "{arguments:?}");
    }
}

/// Motions across a break are not evaluated: a trajectory that stands still while lost has no error in its segments.
///
/// Seen to fail when comments are ignored: segments then cross the break.
#[test]
fn breaks_are_not_crossed() {
    let folder = walks();
    // The estimate lacks ten seconds in the middle of the helix, as an odometry that was lost.
    let text = fs::read_to_string(folder.path().join("truth.tum")).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines.iter_mut().skip(25).for_each(|line| {
        let mut words: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        words[1] += 2.0;
        *line = words.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    });
    lines.insert(25, "# broken: the motion to this pose is unknown".to_owned());
    fs::write(folder.path().join("lost.tum"), lines.join("\n") + "\n").unwrap();
    let (code, out, warned) = eval(folder.path(), &["truth.tum", "lost.tum", "--json", "--segments", "2"]);
    let value: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(code, 0);
    assert!(value["rpe"]["max"].as_f64().unwrap() < 1e-9, "{value}");
    assert_eq!(value["rpe"]["pairs"], 48, "{value}");
    let segment = &value["segments"][0];
    assert!(
        segment["translation_percent"]["mean"].as_f64().unwrap() < 1e-6 && segment["segments"].as_u64().unwrap() > 30,
        "{segment}"
    );
    assert_eq!((&value["breaks"][0]["pose"], &value["end_m"]), (&25.into(), &Value::Null));
    assert!(warned.contains("warning: the trajectory is broken once"), "{warned}");
    let (_, out, _) = eval(folder.path(), &["truth.tum", "lost.tum"]);
    assert!(out.contains("segments   2, with breaks between them"), "{out}");
    // The written trajectory has the same break.
    eval(folder.path(), &["truth.tum", "lost.tum", "--out", "again.tum"]);
    assert!(fs::read_to_string(folder.path().join("again.tum")).unwrap().contains("# broken"));
}

/// A log has the breaks of its odometry: a skipped pair is bridged, a missing motion is a break.
///
/// Seen to fail when a lost motion skips its pair, and when no break is kept.
#[test]
fn breaks_of_a_log_are_not_crossed() {
    let folder = tempfile::tempdir().unwrap();
    // Pairs every 0.2 s; the third is black, and the motion to the fifth is lost.
    let dive = "question = 'Is a break crossed?'\nseed = 1\n\
        [source]\nname = 'dive'\nframes = 7\nrate = 5.0\nstart = 30.4\n\
        rig.size = [512, 384]\nrig.focal = 250.0\nwater.attenuation = 0.15\n\
        faults = [{ device = 'images', kind = 'off', from = 30.7, to = 30.9, amount = 0.0 }]\n\
        [navigation]\nfaults = [{ kind = 'off', from = 0.7, to = 0.9 }]\n";
    fs::write(folder.path().join("dive.toml"), dive).unwrap();
    ended_with(0, program().current_dir(folder.path()).args(["run", "dive.toml", "--out", "run"]));
    let log = fs::read_dir(folder.path().join("run")).unwrap().map(|entry| entry.unwrap().path());
    let log = log.into_iter().find(|file| file.extension().is_some_and(|ending| ending == "mcap")).unwrap();
    let log = log.to_str().unwrap();
    let (code, out, warned) = eval(folder.path(), &[log, "--json", "--out", "way.tum"]);
    let value: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(code, 0);
    assert_eq!((&value["matched"]["estimate"], &value["rpe"]["pairs"]), (&6.into(), &4.into()), "{value}");
    assert_eq!(
        (&value["breaks"][0]["pose"], &value["breaks"][1], &value["end_m"]),
        (&3.into(), &Value::Null, &Value::Null)
    );
    assert!(value["rpe"]["max"].as_f64().unwrap() < 0.02, "{value}");
    assert!(warned.contains("warning: the trajectory is broken once"), "{warned}");
    // The same trajectory in a file has the same errors.
    let (_, of_file, _) = eval(folder.path(), &[log, "way.tum", "--json"]);
    let of_file: Value = serde_json::from_str(&of_file).unwrap();
    assert_eq!((&of_file["rpe"]["pairs"], &of_file["breaks"]), (&value["rpe"]["pairs"], &value["breaks"]));
}

/// Seen to fail when the order of quaternions or lines is not checked.
#[test]
fn orders_are_not_guessed() {
    let folder = walks();
    walk(folder.path(), "wxyz.tum", |t| format!("{t} {t} 0 0 1 0 0 0\n"));
    let (code, _, error) = eval(folder.path(), &["truth.tum", "wxyz.tum"]);
    assert!(code == 3 && error.contains("w first in wxyz.tum:1") && error.lines().count() == 1, "{error}");
    fs::write(folder.path().join("mixed.tum"), "2 2 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 9 0 0 0 0 0 1\n").unwrap();
    let (code, _, error) = eval(folder.path(), &["truth.tum", "mixed.tum"]);
    assert!(code == 3 && error.contains("mixed.tum:2"), "{error}");
    let (code, out, _) = eval(folder.path(), &["truth.tum", "mixed.tum", "--sort-stamps", "--json"]);
    assert_eq!((code, &serde_json::from_str::<Value>(&out).unwrap()["matched"]["poses"]), (0, &2.into()));
}
