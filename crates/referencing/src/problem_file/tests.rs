//! Problem files and their answers.

use std::path::Path;

use super::*;
use crate::{
    accept::{acceptance::Acceptance, max_p_wrong::MaxPWrong},
    search::{identification::Search, maximum_clique::MaximumClique, rigid_consensus::RigidConsensus},
    solve::{SOLVERS, kabsch::Kabsch},
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_component::{Choice, Fault};

/// Five points seen from the origin of a camera 3 m in front of them, without errors.
const GOOD: &str = r#"{"format": "coherence-problem/1", "id": "x", "family": "t", "seed_set": "own", "seed": 1,
"model": [[0,0,0],[1,0,0],[0.25,-0.75,0],[0.5,0.5,1],[-0.5,0.25,0.5]],
"cloud": [[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]],
"sigma": 0.01, "delta": 0.04,
"prior": {"T_cam_obj": [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], "shell_half_m": 0.1},
"putative": null}"#;

const GOOD_PRIOR: &str = r#"{"T_cam_obj": [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], "shell_half_m": 0.1}"#;

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
        expand_gates: false,
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
        "consensus_bound",
        "nfa",
        "time_ms",
    ];
    assert!(keys.iter().all(|key| answer.get(key).is_some()), "{answer}");
    assert_eq!((answer["outcome"].as_str(), answer["reason"].is_null()), (Some("fix"), true), "{answer}");
    assert_eq!(answer["pairs"], serde_json::json!([[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]));
    assert!((answer["T_cam_obj"][2][3].as_f64().unwrap() - 3.0).abs() < 1e-12, "camera from object");
    assert_eq!(answer["covariance"].as_array().unwrap().len(), 6);
}

/// Of five points with σ = 1 cm the depth error is zero; a plane seen face-on has none and keeps its scale error.
#[test]
fn the_depth_error_is_an_optional_key() {
    let integrity = &solved(GOOD)["integrity"];
    let depth_error = |key: &str| integrity["depth_error"][key].as_f64().unwrap();
    assert!(depth_error("value").abs() < 1e-9 && (0.005..0.05).contains(&depth_error("sigma")), "{integrity}");
    let flat = GOOD
        .replace("[0.5,0.5,1],[-0.5,0.25,0.5]", "[0.5,0.5,0],[-0.5,0.25,0]")
        .replace("[0.5,0.5,4],[-0.5,0.25,3.5]", "[0.5,0.5,3],[-0.5,0.25,3]");
    let integrity = &solved(&flat)["integrity"];
    assert!(integrity.get("depth_error").is_none() && integrity["scale_error"]["sigma"].is_f64(), "{integrity}");
}

/// A model an eighth too large, under noise that admits it: umeyama reports 9/8, the other solvers nothing.
#[test]
fn the_scale_is_reported_by_the_solver_that_finds_it() {
    let mut problem = parse(&GOOD.replace("0.01", "0.1").replace("0.04", "0.3")).unwrap();
    for point in &mut problem.model {
        point.at.coords *= 1.125;
    }
    problem.prior = None;
    problem.putative = Some((0..5).map(|k| (k, k)).collect());
    // Wide limits: this test covers no search.
    let acceptance = Acceptance {
        max_p_wrong: MaxPWrong::Number(1.0),
        alert_limit: 1.0,
        alert_fraction: 1.0,
        attitude_limit: 1.0,
        ..Acceptance::default()
    };
    let of = |name| {
        let solver = SOLVERS.build(&Choice::named(name)).unwrap();
        let (search, rng) = (MaximumClique::default(), &mut ChaCha8Rng::seed_from_u64(0));
        let search = ("maximum-clique", &search as &dyn Search);
        let method = Method { search, solver: (name, &*solver), acceptance: &acceptance, expand_gates: false };
        let answer = answer(&problem, Path::new("p.json"), &method, rng);
        assert_eq!(answer.outcome, "fix", "{answer:?}");
        answer.scale
    };
    assert!((of("umeyama").unwrap() - 1.125).abs() < 1e-12);
    assert_eq!(of("kabsch"), None);
}

/// A file has no rig: a cloud behind the camera is answered, and its points are listed.
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
        (Some("fix"), &serde_json::json!([0, 1, 2, 3, 4])),
        "{answer}"
    );
}

#[test]
fn a_rejection_has_no_pose() {
    let text = GOOD.replace("\"putative\": null", "\"putative\": [[0,0],[1,1]]");
    let answer = solved(&text);
    assert_eq!((answer["outcome"].as_str(), answer["reason"].as_str()), (Some("rejected"), Some("too-few")));
    assert!(["T_cam_obj", "covariance", "pairs"].iter().all(|key| answer[key].is_null()), "{answer}");
}

#[test]
fn candidates_come_from_pairs_gates_or_everything() {
    let problem = parse(GOOD).unwrap();
    assert_eq!(problem.candidates().unwrap().lists, [[0], [1], [2], [3], [4]].map(Vec::from));
    let all = CoherenceProblem { prior: None, ..problem.clone() };
    assert_eq!(all.candidates().unwrap().pairs(), 25);
    let pairs = CoherenceProblem { putative: Some(vec![(2, 4), (2, 1), (2, 4)]), ..problem };
    assert_eq!(pairs.candidates().unwrap().lists[2], [1, 4]);
}

const MODEL: &str = "[[0,0,0],[1,0,0],[0.25,-0.75,0],[0.5,0.5,1],[-0.5,0.25,0.5]]";
const CLOUD: &str = "[[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]]";

/// The warnings about the valid problem with these changes.
fn warnings(changes: &[(&str, &str)]) -> Vec<String> {
    let text = changes.iter().fold(GOOD.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "the good problem has no `{from}`");
        text.replacen(from, to, 1)
    });
    let problem = parse(&text).expect("a valid problem");
    problem.warnings(Path::new("p.json")).iter().map(ToString::to_string).collect()
}

/// A JSON list of `count` points.
fn places(count: usize, of: impl Fn(f64) -> [f64; 3]) -> String {
    serde_json::to_string(&(0..count).map(|k| of(k as f64)).collect::<Vec<_>>()).unwrap()
}

/// B4 and B7.
#[test]
fn coincident_points_are_rejected_and_unlikely_values_are_reported() {
    assert_eq!(
        fault("[1,0,0]", "[0.25,-0.75,1e-7]"),
        "coincident model points in p.json:2:37: points 1 and 2; remove one"
    );
    assert!(warnings(&[]).is_empty());
    let row = "[0.25,-0.75,3],[0.5";
    let no_prior = (GOOD_PRIOR, "null");
    for (changes, expected) in [
        (
            vec![("[1,0,0]", "[0.25,-0.68,0]")],
            "model points closer than 2Δ in p.json: points 1 and 2, 0.07 m apart, and Δ = 0.04 m; they may be \
             confused; keep model points at least 2Δ apart",
        ),
        (
            vec![("[1,0,0]", "[1000,0,0]")],
            "implausible units in p.json: the diagonal of the model's bounding box is 1000",
        ),
        (vec![(MODEL, "[]")], "the model has too few points in p.json: 0 points; a pose needs at least three"),
        (vec![(MODEL, "[[0,0,0]]")], "the model has too few points in p.json: 1 point; a pose"),
        (vec![(MODEL, "[[0,0,0],[1,0,0],[2,0,0.0005],[3,0,0]]"), no_prior], "collinear model points in p.json: second"),
        // A half-turn maps four points onto each other within a few millimetres, and no five.
        (
            vec![(MODEL, "[[1,0.5,0],[-1,-0.502,0],[0.2,-0.7,0.6],[-0.201,0.7,0.6]]"), no_prior],
            "the model is symmetric in p.json: after a rotation by 180° each point is within 0.001076 m of another",
        ),
        // The cloud.
        (vec![(CLOUD, "[]")], "the cloud has no points in p.json: 0 points; add measured points"),
        (vec![(CLOUD, "[[0,0,3]]")], "the cloud has too few points in p.json: 1 point; a pose needs at least three"),
        (
            vec![(CLOUD, "[[0,0,3],[0,0,3],[0,0,3]]"), no_prior],
            "coincident cloud points in p.json: 3 points in a bounding box of 0 m",
        ),
        (
            vec![(CLOUD, &places(9, |k| [k, 0.0, 3.0])), no_prior],
            "collinear cloud points in p.json: second extent over first 0.0e0;",
        ),
        (
            vec![(CLOUD, "[[0,0,3],[0.2,0,3],[0,0.2,3]]"), no_prior],
            "the cloud is smaller than the model in p.json: bounding box with a diagonal of 0.2828 m, no two model \
             points within 0.7",
        ),
        (
            vec![(CLOUD, &places(40, |k| [k, 40.0 * (k % 7.0), 90.0 * (k % 3.0)].map(|x| 10.0 * x))), no_prior],
            "implausible units in p.json: half of the cloud lies in a bounding box with a diagonal of 2435.077 m; give \
             coordinates in metres",
        ),
        (
            vec![(CLOUD, "[[0,0,300],[100,0,300],[25,-75,300],[50,50,400],[-50,25,350]]"), no_prior],
            "cloud points too far apart in p.json: no two cloud points are within 2.1",
        ),
        // Noise.
        (vec![("\"sigma\": 0.01", "\"sigma\": 0")], "points without noise in p.json: cloud point 0, 0 m"),
        (
            vec![(
                "\"sigma\": 0.01",
                "\"sigma\": 0.01, \"sigma_xyz\": [[1e-2,1e-2,1e-2],[0.01,0,0.03],[0,0.01,0.01],[0.01,0.01,0.01],[0.01,0.01,0.01]]",
            )],
            "zero noise along one axis in p.json: cloud point 1, [0.01, 0, 0.03] m; no measurement is more precise",
        ),
        (
            vec![("\"sigma\": 0.01", "\"sigma\": 1e15"), no_prior],
            "noise larger than the model in p.json: σ = 1e15 m, the diagonal of the model's bounding box is 2.1",
        ),
        (vec![("0.04", "0.0009")], "`delta` is far below the noise in p.json: Δ = 9e-4 m, σ = 0.01 m; few true pairs"),
        (
            vec![("\"shell_half_m\": 0.1", "\"shell_half_m\": 1e-30"), ("0.05]", "0]")],
            "`prior.shell_half_m` is far below the noise in p.json: 1e-30 m, σ = 0.01 m; few true points",
        ),
        (
            vec![("\"shell_half_m\": 0.1", "\"shell_half_m\": 100")],
            "`prior.shell_half_m` excludes nothing in p.json: 100 m, half of the cloud lies in a bounding box of",
        ),
        // Putative pairs.
        (vec![("null}", "[[0,0],[1,0],[0,1]]}")], "`putative` has too few pairs in p.json: 3 pairs of 2 model points;"),
        (vec![("null}", "[[0,0]]}")], "`putative` has too few pairs in p.json: 1 pair of 1 model point;"),
        (
            vec![("null}", "[[0,0],[1,1],[2,0],[3,1]]}")],
            "`putative` has too few pairs in p.json: 4 pairs of 2 cloud points;",
        ),
        (
            vec![("[0.25,-0.75,0]", "[-1,0,0]"), ("null}", "[[0,0],[1,1],[2,2]]}")],
            "collinear model points in `putative` in p.json: 3 of 5, second extent over first 0.0e0; collinear",
        ),
        (
            vec![(row, "[2,0,3],[0.5"), ("null}", "[[0,0],[1,1],[2,2]]}")],
            "collinear cloud points in `putative` in p.json: 3 of 5, second",
        ),
        // Repeated points.
        (
            vec![("[0.5,0.5,4]", "[0.25,-0.75,3]"), ("null}", "[[0,0],[1,1],[2,2],[3,2],[3,3],[4,4]]}")],
            "repeated cloud points in p.json: 1 of 5, e.g. 3 and 2; equal coordinates are one point; each takes part",
        ),
        (
            vec![
                (CLOUD, &places(24, |k| [(k / 4.0).floor() * 0.3, (k / 8.0).floor(), 3.0 + 0.004 * (k % 4.0)])),
                no_prior,
            ],
            "repeated measurements in p.json: 24 of 24 cloud points have 2 or more others within 0.04 m; give each place",
        ),
        // The prior.
        (
            vec![("0.05]", "1e300]")],
            "the prior places the object too far away in p.json: its nearest point is 1e300 m away",
        ),
        (
            vec![("[0,0,1,3]", "[0,0,1,-3]")],
            "the prior places the object behind the camera in p.json: its largest z is -2 m; `T_cam_obj`",
        ),
        (vec![("0.05]", "5]")], "too few gates contain a cloud point in p.json: 0 of 5 model points; a pose"),
        // The candidates.
        (
            vec![(CLOUD, &places(9000, |k| [k.sin(), (2.0 * k).sin(), k.cos() + 3.0])), no_prior],
            "too many candidate pairs in p.json: 45000, the limit of `rigid-consensus` is 40000; give a prior pose",
        ),
    ] {
        let reported = warnings(&changes);
        assert!(reported.len() == 1 && reported[0].starts_with(expected), "{expected}: {reported:?}");
        assert!(reported[0].len() < 300, "{reported:?}");
    }
}

/// A few distant outliers, or a moderate number of collinear points, cause no warning.
#[test]
fn usual_clouds_are_not_warned_of() {
    let no_prior = (GOOD_PRIOR, "null");
    let blunder = CLOUD.replace("[-0.5,0.25,3.5]", "[-0.5,0.25,3.5],[1e9,0,1e12]");
    let half = CLOUD.replace("]]", "],[2,0,3],[3,0,3],[4,0,3],[5,0,3]]");
    let largest = CLOUD.replace("[-0.5,0.25,3.5]", "[-0.5,0.25,3.5],[1e308,-1e308,1e308],[-1e308,1e308,1e308]");
    for cloud in [blunder, half, largest] {
        let reported = warnings(&[(CLOUD, &cloud), no_prior]);
        assert!(reported.is_empty(), "{cloud}: {reported:?}");
        let reported = warnings(&[(CLOUD, &cloud), no_prior, ("null}", "[[0,0],[1,1],[2,2],[3,3],[4,5]]}")]);
        assert!(reported.is_empty(), "{cloud}: {reported:?}");
    }
}

/// Gates with too many pairs to list are rejected before they are listed.
#[test]
fn gates_that_hold_too_much_are_rejected() {
    let cloud = places(2001, |k| [k.sin(), (2.0 * k).sin(), k.cos() + 3.0]);
    let model = places(2001, |k| [k, (3.0 * k).sin(), k.cos()]);
    let changes = [(CLOUD, cloud.as_str()), (MODEL, &model), ("\"shell_half_m\": 0.1", "\"shell_half_m\": 1e9")];
    let reported = warnings(&changes);
    let many = "too many candidate pairs in p.json: at least 4002000, the limit of `rigid-consensus` is 40000; give a prior \
         pose";
    assert!(reported.iter().any(|reported| reported.starts_with(many)), "{reported:?}");
    let sound = changes.map(|(from, to)| (from, if to.ends_with("1e9") { "\"shell_half_m\": 0.1" } else { to }));
    let reported = warnings(&sound);
    assert!(!reported.iter().any(|reported| reported.contains("candidate")), "{reported:?}");
}

#[test]
fn the_nearest_two_of_many_points_are_found() {
    use crate::site::{model::ModelPoint, target::nearest_two};
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
fn a_file_that_is_not_there_is_a_line() {
    let method = Method {
        search: ("maximum-clique", &MaximumClique::default()),
        solver: ("kabsch", &Kabsch::default()),
        acceptance: &Acceptance::default(),
        expand_gates: false,
    };
    let line = solve_file(Path::new("no/such/file.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
    assert!(matches!(&line, Line::Failed { error, .. } if error.starts_with("cannot read (")), "{line:?}");
    assert!(serde_json::to_value(&line).unwrap().get("error").is_some());
}

/// A displaced object: its gates are empty, gates of twice the size contain it, or none do and every point is a
/// candidate.
#[test]
fn a_displaced_object_is_found_in_larger_gates_or_without() {
    let outcome = |x: &str, expand_gates: bool| {
        let text = GOOD.replace("0.05],[0,1,0,0]", &format!("{x}],[0,1,0,0]"));
        let method = Method {
            search: ("rigid-consensus", &RigidConsensus::default()),
            solver: ("kabsch", &Kabsch::default()),
            acceptance: &Acceptance::default(),
            expand_gates,
        };
        let rng = &mut ChaCha8Rng::seed_from_u64(0);
        answer(&parse(&text).unwrap(), Path::new("p.json"), &method, rng).outcome
    };
    assert_eq!(outcome("0.05", false), "fix");
    for x in ["0.15", "0.35", "5.0"] {
        assert_eq!((outcome(x, false), outcome(x, true)), ("rejected", "fix"), "{x} m beside");
    }
}

/// B36. A cloud of ten million points is rejected by the size of its file before it is read, and one above the maximum
/// number by its count.
#[test]
fn a_cloud_too_large_to_hold_is_rejected() {
    let file = std::env::temp_dir().join(format!("seafix-ten-million-{}.json", std::process::id()));
    // Ten million points of twenty bytes; the file has a length and no content.
    std::fs::File::create(&file).and_then(|empty| empty.set_len(200_000_000)).unwrap();
    let rejected = read(&file).expect_err("it is too large").to_string();
    std::fs::remove_file(&file).unwrap();
    assert!(rejected.starts_with("problem file too large in ") && rejected.contains("48 MiB"), "{rejected}");
    let points = "[0,0,3],".repeat(500_001);
    let rejected = parse(&GOOD.replace("[-0.5,0.25,3.5]]", &format!("{points}[0,0,3]]"))).unwrap_err().to_string();
    assert!(rejected.starts_with("too many points in `cloud` in p.json:3:10: 500006; at most 500000"), "{rejected}");
}

mod edges;
mod invalid;
