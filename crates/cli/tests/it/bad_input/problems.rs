//! Problem files: a fault for each element, warnings of improbable values.

use std::fs;

use tempfile::TempDir;

use super::rejected;
use crate::program;

#[test]
fn a_bad_problem_among_good_ones() {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).unwrap();
        folder.path().join(name).to_str().unwrap().to_owned()
    };
    let good = r#"{"format":"coherence-problem/1","id":"t","model":[[0,0,0],[1,0,0],[0,2,0],[0,0,3]],
        "cloud":[[0,0,5],[1,0,5],[0,2,5],[0,0,8]],"sigma":0.001,"delta":0.01,"prior":null,"putative":null}"#;
    let good = put("good.json", good);
    let bad = put("bad.json", "{\"format\": \"coherence-problem/1\"}");
    let output = program().args(["solve", "--json", &bad, &good]).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let lines: Vec<serde_json::Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines[0]["error"].as_str().unwrap().contains("bad.json"));
    assert_eq!(lines[1]["outcome"], "fix", "{}", lines[1]);
    assert!(output.stderr.is_empty(), "a line of JSON states the error");
    let output = program().args(["solve", &bad, &good]).output().unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!((output.status.code(), error.lines().count()), (Some(3), 1), "{error}");
    assert!(error.starts_with("error: ") && error.contains("bad.json") && !out.contains("bad.json"), "{error}\n{out}");
    assert!(out.contains("good.json: fix"), "{out}");
}

const PROBLEM: &str = r#"{"format": "coherence-problem/1", "id": "t",
"model": [[0,0,0],[1,0,0],[0,2,0],[0,0,3]],
"cloud": [[0,0,5],[1,0,5],[0,2,5],[0,0,8]],
"sigma": 0.001, "delta": 0.01, "prior": null, "putative": null}"#;

/// Each of these changes of a valid problem is one line with element, place, value and remedy: an error of `solve`, a
/// finding of `check`.
#[test]
fn problems_that_cannot_be() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("p.json");
    for (from, to, expected) in [
        ("[1,0,5]", "[1,\"x\",5]", "`cloud[1][1]` is not a number in p.json:3:22: \"x\"; give a number, in metres"),
        ("[1,0,5]", "[1,NaN,5]", "`cloud[1][1]`: NaN is not a JSON number in p.json:3:22; give a number, in metres"),
        ("[1,0,5]", "[1,5]", "`cloud[1]` has 2 values in p.json:3:19: [1,5]; give three numbers x y z, in metres"),
        ("\"delta\": 0.01, ", "", "`delta` is missing in p.json:1:1; give the distance tolerance"),
        ("0.01", "1e300", "`delta` is out of range in p.json:4:26: 1e300; allowed: above 0"),
        (
            "\"putative\": null",
            "\"putative\": [[0,-1]]",
            "`putative[0][1]` is not an index in p.json:4:63: -1; give a whole",
        ),
        (
            "null}",
            "null}\nmore",
            "trailing characters after the problem in p.json:5:1: more; give one problem per file",
        ),
    ] {
        assert!(PROBLEM.contains(from), "no {from}");
        fs::write(&file, PROBLEM.replacen(from, to, 1)).unwrap();
        for (command, start, code) in [("solve", "error: ", 3), ("check", "fault: ", 1)] {
            let output = program().arg(command).arg(&file).output().unwrap();
            // Errors are on standard error, findings on standard output.
            let (said, silent) = match command {
                "solve" => (output.stderr, output.stdout),
                _ => (output.stdout, output.stderr),
            };
            assert!(silent.is_empty(), "{}", String::from_utf8_lossy(&silent));
            let said = String::from_utf8(said).unwrap().replace(folder.path().to_str().unwrap(), "");
            assert_eq!((output.status.code(), said.lines().count()), (Some(code), 1), "{said}");
            assert!(said.replace("/p.json", "p.json").starts_with(&format!("{start}{expected}")), "{expected}\n{said}");
        }
    }
}

/// Valid but improbable values are warnings of `check`, not findings.
#[test]
fn problems_that_are_hardly_meant() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("p.json");
    let prior = r#""prior": {"T_cam_obj": [[1,0,0,0],[0,1,0,0],[0,0,1,-9],[0,0,0,1]], "shell_half_m": 0.5}"#;
    for (from, to, expected) in [
        ("\"sigma\"", "\"sigma\"", ""),
        (
            "[[0,0,5],[1,0,5],[0,2,5],[0,0,8]]",
            "[[0,0,5]]",
            "the cloud has too few points in p.json: 1 point; a pose needs",
        ),
        ("0.001", "1", "`delta` is far below the noise in p.json: Δ = 0.01 m, σ = 1 m; "),
        ("\"prior\": null", prior, "the prior places the object behind the camera in p.json: its largest z is -6 m; "),
    ] {
        assert!(PROBLEM.contains(from), "no {from}");
        fs::write(&file, PROBLEM.replacen(from, to, 1)).unwrap();
        let output = program().arg("check").arg(&file).output().unwrap();
        let said = String::from_utf8(output.stdout).unwrap().replace(folder.path().to_str().unwrap(), "");
        let said = said.replace("/p.json", "p.json");
        let warned = if expected.is_empty() {
            said == "p.json: in order\n"
        } else {
            said.contains(&format!("warning: {expected}"))
        };
        assert!(output.status.code() == Some(0) && warned, "{expected}\n{said}");
    }
}

#[test]
fn an_unknown_search_of_solve() {
    rejected(&["solve", "--search", "maximum-click", "x.json"], 2, &["did you mean `maximum-clique`?"]);
}
