//! `seafix solve`: integrity of fixes, rejected settings.

use serde_json::{Value, json};

use crate::program;

/// The file of an exact problem of seven points.
fn problem(folder: &tempfile::TempDir) -> String {
    let model = [
        [0.0, 0.0, 0.0],
        [1.0, 0.1, 0.0],
        [0.2, 1.3, 0.1],
        [0.4, 0.3, 0.9],
        [-0.7, 0.5, 0.4],
        [0.6, -0.8, 0.3],
        [-0.3, -0.9, 0.2],
    ];
    let cloud: Vec<[f64; 3]> = model.iter().map(|[x, y, z]| [x + 0.1, y - 0.2, z + 4.0]).collect();
    let text = json!({
        "format": "coherence-problem/1", "id": "seven", "family": "test", "seed_set": "test", "seed": 1,
        "model": model, "cloud": cloud, "sigma": 0.002, "delta": 0.01, "prior": null, "putative": null,
    });
    let file = folder.path().join("seven.json");
    std::fs::write(&file, text.to_string()).unwrap();
    file.display().to_string()
}

fn solve(arguments: &[&str]) -> std::process::Output {
    program().arg("solve").args(arguments).output().unwrap()
}

#[test]
fn a_fix_states_what_supports_it() {
    let folder = tempfile::tempdir().unwrap();
    let output = solve(&[&problem(&folder), "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["outcome"], "fix");
    let integrity = &answer["integrity"];
    assert_eq!((&integrity["redundancy"], &integrity["dof"]), (&json!("excludable"), &json!(15)));
    assert!(integrity["chi2"].as_f64().unwrap() < 1e-9 && integrity["chi2_limit"].as_f64().unwrap() > 15.0);
    let level = integrity["protection"]["position"].as_f64().unwrap();
    assert!(level > 0.002 && level < 0.1, "{level}");
    assert!(integrity["protection"]["attitude"].as_f64().unwrap() > 0.0);
    // A twentieth of the diameter of some two metres is at least ten centimetres.
    assert_eq!(integrity["alert_limit"], 0.1);
    for (fraction, is) in [(1.01, "within"), (0.99, "beyond")] {
        let limit = fraction * level;
        let output = solve(&[&problem(&folder), "--set", &format!("acceptance.alert-limit={limit}")]);
        let message = String::from_utf8(output.stdout).unwrap();
        let expected = format!("; {is} the alert limit of {limit:.3} m");
        assert!(
            message.contains(&format!("protection level {level:.3} m, ")) && message.contains(&expected),
            "{message}"
        );
    }
}

/// Eight points that a half-turn maps onto each other, except for one with an offset (mm).
fn nearly_symmetric(folder: &tempfile::TempDir, off: f64) -> String {
    let half = [[0.6, 0.3, 0.1], [0.2, -0.7, 0.4], [0.5, 0.5, -0.3], [0.1, 0.4, -0.5]];
    let mut model: Vec<[f64; 3]> = half.iter().flat_map(|&[x, y, z]| [[x, y, z], [-x, -y, z]]).collect();
    model[0][2] += 1e-3 * off;
    let cloud: Vec<[f64; 3]> = model.iter().map(|[x, y, z]| [x + 0.1, y - 0.2, z + 4.0]).collect();
    let text = json!({
        "format": "coherence-problem/1", "id": "symmetric", "family": "test", "seed_set": "test", "seed": 1,
        "model": model, "cloud": cloud, "sigma": 0.002, "delta": 0.012, "prior": null, "putative": null,
    });
    let file = folder.path().join("symmetric.json");
    std::fs::write(&file, text.to_string()).unwrap();
    file.display().to_string()
}

/// An offset of 4 mm leaves the poses ambiguous. With 7 mm the alternative is improbable enough for a fix, but not for
/// a protection level at a risk of 5e-4; with 8 mm there is a level.
///
/// Seen to fail when levels ignore alternative poses.
#[test]
fn a_missing_level_has_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let risk = ["--set", "acceptance.risk=5e-4"];
    let message =
        |off| String::from_utf8(solve(&[&[&*nearly_symmetric(&folder, off)], &risk[..]].concat()).stdout).unwrap();
    assert!(message(4.0).contains("ambiguous"), "{}", message(4.0));
    let file = nearly_symmetric(&folder, 7.0);
    let answer: Value = serde_json::from_slice(&solve(&[&[&*file, "--json"], &risk[..]].concat()).stdout).unwrap();
    let integrity = &answer["integrity"];
    let (mistaken, risk) = (integrity["misidentified"].as_f64().unwrap(), integrity["risk"].as_f64().unwrap());
    assert!(mistaken > risk && mistaken < 1e-3 && integrity["protection"].is_null(), "{integrity}");
    assert_eq!(answer["p_wrong"], integrity["misidentified"]);
    let expected = format!(
        "no protection level: probability of a misidentification {mistaken:.1e} above the risk {risk:.0e}; \
         not protected within the alert limit of {:.3} m",
        integrity["alert_limit"].as_f64().unwrap()
    );
    assert!(message(7.0).contains(&expected), "{}", message(7.0));
    assert!(message(8.0).contains("  protection level 0.0"), "{}", message(8.0));
}

#[test]
fn a_solver_of_pixels_is_rejected_on_points_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = problem(&folder);
    for name in ["l-bfgs", "nelder-mead", "p3p-stereo", "stereo-reprojection"] {
        let output = solve(&[&file, "--solver", name]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(name) && message.contains("`mahalanobis`") && output.stdout.is_empty(), "{message}");
    }
}

/// Seen to fail when the settings of `--set` are parsed and not used.
#[test]
fn settings_are_used_and_wrong_ones_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = problem(&folder);
    let message = |settings: &[&str]| {
        let output = solve(&[&["--json", &path], settings].concat());
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        (output.status.code().unwrap(), text)
    };
    let (code, text) = message(&["--search", "maximum-clique", "--set", "search.budget=1"]);
    assert!(code == 0 && text.contains(r#""reason":"budget""#), "{text}");
    let (code, text) = message(&["--set", "acceptance.min-points=100"]);
    assert!(code == 0 && text.contains(r#""outcome":"rejected""#), "{text}");
    for (setting, named) in [
        ("search.budgte=1", "`budgte`, did you mean `budget`?"),
        ("search.budget=0", "budget"),
        ("detector.sigma=1.5", "`detector`"),
        ("acceptance.max-p-wrong=2.0", "max-p-wrong"),
        ("acceptance.max-p-wrong=lax", "strict, balanced or permissive"),
        ("acceptance.absence=1e-3", "max-p-wrong"),
        ("acceptance.max-nfa=1.0", "max-p-wrong"),
    ] {
        let (code, text) = message(&["--set", setting]);
        assert!(code == 2 && text.contains(named) && text.lines().count() == 1, "{setting}: {code} {text}");
    }
}
