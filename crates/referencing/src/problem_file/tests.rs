//! Problems as files and their answers.

use std::path::Path;

use super::*;
use crate::{Acceptance, Kabsch, MaximumClique, RigidConsensus, SOLVERS, Search};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_component::{Choice, Fault};

/// Five points seen from the origin of a camera 3 m in front of them, as exact numbers.
const GOOD: &str = r#"{"format": "coherence-problem/1", "id": "x", "family": "t", "seed_set": "own", "seed": 1,
"model": [[0,0,0],[1,0,0],[0.25,-0.75,0],[0.5,0.5,1],[-0.5,0.25,0.5]],
"cloud": [[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]],
"sigma": 0.01, "delta": 0.04,
"prior": {"T_cam_obj": [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], "shell_half_m": 0.1},
"putative": null}"#;

fn parse(text: &str) -> Result<CoherenceProblem, Fault> {
    CoherenceProblem::parse(text, Path::new("p.json"))
}

fn fault(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "the good problem has no `{from}`");
    parse(&GOOD.replacen(from, to, 1)).expect_err("the problem is broken").to_string()
}

fn solved(text: &str) -> serde_json::Value {
    let method = Method {
        search: ("maximum-clique", &MaximumClique::default()),
        solver: ("kabsch", &Kabsch::default()),
        acceptance: &Acceptance::default(),
        widen: false,
    };
    let answer = answer(&parse(text).unwrap(), Path::new("p.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
    serde_json::to_value(Line::Answer(Box::new(answer))).unwrap()
}

#[test]
fn a_good_problem_is_answered_with_the_keys_of_the_format() {
    let answer = solved(GOOD);
    let keys = [
        "file",
        "id",
        "outcome",
        "reason",
        "T_cam_obj",
        "covariance",
        "pairs",
        "alternatives",
        "runner_up",
        "unbelieved",
        "margin",
        "optimal",
        "size_bound",
        "expected_chance_sets",
        "time_ms",
    ];
    assert!(keys.iter().all(|key| answer.get(key).is_some()), "{answer}");
    assert_eq!((answer["outcome"].as_str(), answer["reason"].is_null()), (Some("referenced"), true), "{answer}");
    assert_eq!(answer["pairs"], serde_json::json!([[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]));
    assert!((answer["T_cam_obj"][2][3].as_f64().unwrap() - 3.0).abs() < 1e-12, "camera from object");
    assert_eq!(answer["covariance"].as_array().unwrap().len(), 6);
}

/// A model an eighth too large, under noise that lets it pass: umeyama tells 9/8, the other solvers nothing.
#[test]
fn the_scale_is_told_by_the_solver_that_finds_it() {
    let mut problem = parse(&GOOD.replace("0.01", "0.1").replace("0.04", "0.3")).unwrap();
    for point in &mut problem.model {
        point.at.coords *= 1.125;
    }
    problem.prior = None;
    problem.putative = Some((0..5).map(|k| (k, k)).collect());
    // What is weak here is let pass: no search is under test.
    let acceptance = Acceptance {
        chance_budget: f64::INFINITY,
        alert_limit: 1.0,
        alert_share: 1.0,
        attitude_limit: 1.0,
        ..Acceptance::default()
    };
    let of = |name| {
        let solver = SOLVERS.build(&Choice::named(name)).unwrap();
        let (search, rng) = (MaximumClique::default(), &mut ChaCha8Rng::seed_from_u64(0));
        let search = ("maximum-clique", &search as &dyn Search);
        let method = Method { search, solver: (name, &*solver), acceptance: &acceptance, widen: false };
        let answer = answer(&problem, Path::new("p.json"), &method, rng);
        assert_eq!(answer.outcome, "referenced", "{answer:?}");
        answer.scale
    };
    assert!((of("umeyama").unwrap() - 1.125).abs() < 1e-12);
    assert_eq!(of("kabsch"), None);
}

/// A file knows no rig: a cloud behind the camera is answered as it is given, and its points are named.
#[test]
fn identified_points_behind_the_camera_are_named() {
    assert!(solved(GOOD).get("behind").is_none());
    let back = GOOD
        .replace(
            "[[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]]",
            "[[0,0,-1],[1,0,-1],[0.25,-0.75,-1],[0.5,0.5,0],[-0.5,0.25,-0.5]]",
        )
        .replace("[0,0,1,3]", "[0,0,1,-1]");
    let answer = solved(&back);
    assert_eq!(
        (answer["outcome"].as_str(), &answer["behind"]),
        (Some("referenced"), &serde_json::json!([0, 1, 2, 3, 4])),
        "{answer}"
    );
}

#[test]
fn a_refusal_has_no_pose() {
    let text = GOOD.replace("\"putative\": null", "\"putative\": [[0,0],[1,1]]");
    let answer = solved(&text);
    assert_eq!((answer["outcome"].as_str(), answer["reason"].as_str()), (Some("unidentified"), Some("too-few")));
    assert!(["T_cam_obj", "covariance", "pairs"].iter().all(|key| answer[key].is_null()), "{answer}");
}

#[test]
fn candidates_come_from_pairs_shells_or_everything() {
    let problem = parse(GOOD).unwrap();
    assert_eq!(problem.candidates().unwrap().lists, [[0], [1], [2], [3], [4]].map(Vec::from));
    let all = CoherenceProblem { prior: None, ..problem.clone() };
    assert_eq!(all.candidates().unwrap().pairs(), 25);
    let pairs = CoherenceProblem { putative: Some(vec![(2, 4), (2, 1), (2, 4)]), ..problem };
    assert_eq!(pairs.candidates().unwrap().lists[2], [1, 4]);
}

/// B4 and B7.
#[test]
fn points_in_one_place_are_refused_and_what_is_hardly_meant_is_told() {
    assert_eq!(
        fault("[1,0,0]", "[0.25,-0.75,1e-7]"),
        "two model points in one place in p.json: points 1 and 2; remove one"
    );
    let warnings = |from: &str, to: &str| {
        let problem = parse(&GOOD.replacen(from, to, 1)).expect("it is legal");
        problem.warnings(Path::new("p.json")).iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert!(warnings("[1,0,0]", "[1,0,0]").is_empty());
    let near = "model points are nearer than 2Δ in p.json: points 1 and 2, 0.0700 m apart, and Δ = 0.04 m; one may be taken for the \
                other; keep model points 2Δ apart";
    assert_eq!(warnings("[1,0,0]", "[0.25,-0.68,0]"), [near]);
    let units = warnings("[1,0,0]", "[1000,0,0]");
    assert!(units.len() == 1 && units[0].starts_with("units? in p.json: the model lies in a box of 1000"), "{units:?}");
    let model = "[[0,0,0],[1,0,0],[0.25,-0.75,0],[0.5,0.5,1],[-0.5,0.25,0.5]]";
    let few = warnings(model, "[]");
    assert_eq!(few, ["the model has too few points in p.json: 0 points; a pose needs at least three"]);
    let line = warnings(model, "[[0,0,0],[1,0,0],[2,0,0.0005],[3,0,0]]");
    assert!(line.len() == 1 && line[0].starts_with("the model's points lie on a line in p.json: second"), "{line:?}");
    let exact = warnings("\"sigma\": 0.01", "\"sigma\": 0");
    assert!(
        exact.len() == 1 && exact[0].starts_with("points without noise in p.json: cloud point 0, 0 m"),
        "{exact:?}"
    );
    let cloud = "[[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]]";
    assert_eq!(warnings(cloud, "[]"), ["the cloud has no points in p.json: 0 points; nothing can be found in it"]);
    let few = warnings("null}", "[[0,0],[1,0],[0,1]]}");
    assert!(few.len() == 1 && few[0].starts_with("`putative` has too few pairs in p.json: 3 pairs of 2"), "{few:?}");
}

#[test]
fn the_nearest_two_of_many_points_are_found() {
    use crate::{ModelPoint, site::nearest_two};
    let step = |k: usize, at: f64| ((k as f64 * at).sin() * 43_758.545_3).fract();
    let points: Vec<ModelPoint> =
        (0..300).map(|k| ModelPoint::exact("", [step(k, 12.9898), step(k, 78.233), step(k, 37.719)].into())).collect();
    let all = (0..300).flat_map(|k| (0..k).map(move |i| (i, k)));
    let known = all.map(|(i, k)| (i, k, points[i].at.distance(&points[k].at))).min_by(|a, b| a.2.total_cmp(&b.2));
    let known = known.expect("there are three hundred");
    assert_eq!(nearest_two(&points, f64::INFINITY), Some(known));
    assert_eq!(nearest_two(&points, known.2), None);
    assert_eq!((nearest_two(&points[..1], 1.0), nearest_two(&[], 1.0)), (None, None));
}

#[test]
fn every_fault_names_its_place() {
    assert_eq!(fault("\"delta\"", "\"delat\""), "unknown key in p.json:4: `delat`; did you mean `delta`?");
    assert!(fault("problem/1", "problem/2").starts_with("unknown format in p.json: `coherence-problem/2`"));
    assert!(fault("0.04", "-1").starts_with("`delta` is out of range in p.json: -1; allowed: above 0, at most"));
    assert!(fault("0.04", "2.0").starts_with("`delta` is out of range in p.json: 2; allowed"));
    // The third and the fourth point are 1.6202 m apart, the shell's diagonal is 2.19 m.
    assert!(fault("0.04", "0.82").ends_with("at most half the model's diameter, 0.8101 m"));
    assert!(parse(&GOOD.replacen("0.04", "0.81", 1)).is_ok());
    assert!(fault("0.01", "-0.01").starts_with("`sigma` is out of range"));
    assert!(fault("[0.5,0.5,1]", "[0.5,1e999,1]").contains("p.json:2"), "no finite number");
    assert!(
        fault("[0.5,0.5,1]", "[0.5,1e10,1]").starts_with("model point 3 is no part of an object in p.json: [0.5, 1")
    );
    assert!(fault("[0.5,0.5,1]", "[0.5,NaN,1]").contains("p.json:2"), "no JSON");
    assert!(fault("[0.5,0.5,1]", "[0.5,1]").contains("p.json:2"), "two coordinates");
    assert!(fault("null}", "[[0,5]]}").starts_with("putative pair 0 points nowhere in p.json: [0, 5]"));
    assert!(fault("[[1,0,0,0.05]", "[[1.1,0,0,0.05]").starts_with("`prior.T_cam_obj` is no rigid motion"));
    assert!(fault("[[1,0,0,0.05]", "[[1.1,0,0,0.05]").contains("in p.json:5"));
    assert!(fault("0.1}", "0}").starts_with("`prior.shell_half_m` is out of range in p.json:5: 0; give"));
    assert_eq!(
        fault("{\"format\"", "[\"format\""),
        "a list where an object is expected in p.json:1: `[`; give one `coherence-problem/1` a file, in braces"
    );
    assert!(
        fault("\"sigma\": 0.01", "\"sigma\": 0.01, \"sigma_xyz\": [[1,1,1]]").starts_with("`sigma_xyz` has the wrong")
    );
    assert!(fault("{\"format\"", "[{\"format\"").contains("in p.json:1"));
}

#[test]
fn a_file_that_is_not_there_is_a_line() {
    let method = Method {
        search: ("maximum-clique", &MaximumClique::default()),
        solver: ("kabsch", &Kabsch::default()),
        acceptance: &Acceptance::default(),
        widen: false,
    };
    let line = solve_file(Path::new("no/such/file.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
    assert!(matches!(&line, Line::Failed { error, .. } if error.starts_with("cannot read (")), "{line:?}");
    assert!(serde_json::to_value(&line).unwrap().get("error").is_some());
}

/// A displaced object: its shells hold nothing, those twice as large hold it, or none do and every point is looked at.
#[test]
fn a_displaced_object_is_found_in_larger_shells_or_without() {
    let outcome = |x: &str, widen: bool| {
        let text = GOOD.replace("0.05],[0,1,0,0]", &format!("{x}],[0,1,0,0]"));
        let method = Method {
            search: ("rigid-consensus", &RigidConsensus::default()),
            solver: ("kabsch", &Kabsch::default()),
            acceptance: &Acceptance::default(),
            widen,
        };
        let rng = &mut ChaCha8Rng::seed_from_u64(0);
        answer(&parse(&text).unwrap(), Path::new("p.json"), &method, rng).outcome
    };
    assert_eq!(outcome("0.05", false), "referenced");
    for x in ["0.15", "0.35", "5.0"] {
        assert_eq!((outcome(x, false), outcome(x, true)), ("unidentified", "referenced"), "{x} m beside");
    }
}

/// B36. A cloud of ten million points is refused by the size of its file before a byte of it is read, and one of more points
/// than are taken by their number.
#[test]
fn a_cloud_too_large_to_hold_is_refused() {
    let file = std::env::temp_dir().join(format!("seafix-ten-million-{}.json", std::process::id()));
    // Ten million points of twenty bytes; the file has a length and no content.
    std::fs::File::create(&file).and_then(|empty| empty.set_len(200_000_000)).unwrap();
    let refused = read(&file).expect_err("it is too large").to_string();
    std::fs::remove_file(&file).unwrap();
    assert!(refused.starts_with("the problem is too large in ") && refused.contains("48 MiB"), "{refused}");
    let points = "[0,0,3],".repeat(500_001);
    let refused = parse(&GOOD.replace("[-0.5,0.25,3.5]]", &format!("{points}[0,0,3]]"))).unwrap_err().to_string();
    assert!(refused.starts_with("too many points in `cloud` in p.json: 500006; at most 500000"), "{refused}");
}
