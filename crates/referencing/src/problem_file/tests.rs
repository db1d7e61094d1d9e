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

/// A model an eighth too large, under noise that lets it pass: umeyama tells 9/8, the other solvers nothing.
#[test]
fn the_scale_is_reported_by_the_solver_that_finds_it() {
    let mut problem = parse(&GOOD.replace("0.01", "0.1").replace("0.04", "0.3")).unwrap();
    for point in &mut problem.model {
        point.at.coords *= 1.125;
    }
    problem.prior = None;
    problem.putative = Some((0..5).map(|k| (k, k)).collect());
    // What is weak here is let pass: no search is under test.
    let acceptance = Acceptance {
        max_nfa: f64::INFINITY,
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
        (Some("fix"), &serde_json::json!([0, 1, 2, 3, 4])),
        "{answer}"
    );
}

#[test]
fn a_refusal_has_no_pose() {
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

/// What is told of the good problem with these changes.
fn warnings(changes: &[(&str, &str)]) -> Vec<String> {
    let text = changes.iter().fold(GOOD.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "the good problem has no `{from}`");
        text.replacen(from, to, 1)
    });
    let problem = parse(&text).expect("it is legal");
    problem.warnings(Path::new("p.json")).iter().map(ToString::to_string).collect()
}

/// Of so many points, a list with these coordinates.
fn places(count: usize, of: impl Fn(f64) -> [f64; 3]) -> String {
    serde_json::to_string(&(0..count).map(|k| of(k as f64)).collect::<Vec<_>>()).unwrap()
}

/// B4 and B7.
#[test]
fn points_in_one_place_are_refused_and_what_is_hardly_meant_is_reported() {
    assert_eq!(
        fault("[1,0,0]", "[0.25,-0.75,1e-7]"),
        "two model points in one place in p.json:2:37: points 1 and 2; remove one"
    );
    assert!(warnings(&[]).is_empty());
    let row = "[0.25,-0.75,3],[0.5";
    let no_prior = (GOOD_PRIOR, "null");
    for (changes, expected) in [
        (
            vec![("[1,0,0]", "[0.25,-0.68,0]")],
            "model points are nearer than 2Δ in p.json: points 1 and 2, 0.07 m apart, and Δ = 0.04 m; one may be taken for the \
             other; keep model points 2Δ apart",
        ),
        (vec![("[1,0,0]", "[1000,0,0]")], "units? in p.json: the model lies in a box of 1000"),
        (vec![(MODEL, "[]")], "the model has too few points in p.json: 0 points; a pose needs at least three"),
        (vec![(MODEL, "[[0,0,0]]")], "the model has too few points in p.json: 1 point; a pose"),
        (
            vec![(MODEL, "[[0,0,0],[1,0,0],[2,0,0.0005],[3,0,0]]"), no_prior],
            "the model's points lie on a line in p.json: second",
        ),
        // A half-turn of four, a few millimetres off; of five none.
        (
            vec![(MODEL, "[[1,0.5,0],[-1,-0.502,0],[0.2,-0.7,0.6],[-0.201,0.7,0.6]]"), no_prior],
            "the model is symmetric in p.json: turned by 180°, each point is within 0.001076 m of another",
        ),
        // The cloud.
        (vec![(CLOUD, "[]")], "the cloud has no points in p.json: 0 points; nothing can be found in it"),
        (vec![(CLOUD, "[[0,0,3]]")], "the cloud has too few points in p.json: 1 point; a pose needs at least three"),
        (
            vec![(CLOUD, "[[0,0,3],[0,0,3],[0,0,3]]"), no_prior],
            "the cloud's points lie in one place in p.json: 3 points in a box of 0 m",
        ),
        (
            vec![(CLOUD, &places(9, |k| [k, 0.0, 3.0])), no_prior],
            "the cloud's points lie on a line in p.json: second extent over first 0.0e0;",
        ),
        (
            vec![(CLOUD, "[[0,0,3],[0.2,0,3],[0,0.2,3]]"), no_prior],
            "the cloud is smaller than the model in p.json: a box of 0.2828 m from corner to corner, and no two model points \
             within 0.7",
        ),
        (
            vec![(CLOUD, &places(40, |k| [k, 40.0 * (k % 7.0), 90.0 * (k % 3.0)].map(|x| 10.0 * x))), no_prior],
            "units? in p.json: half of the cloud lies in a box of 2435.077 m from corner to corner; coordinates are in metres",
        ),
        (
            vec![(CLOUD, "[[0,0,300],[100,0,300],[25,-75,300],[50,50,400],[-50,25,350]]"), no_prior],
            "the cloud's points are too far apart in p.json: no two cloud points are within the 2.1",
        ),
        // Noise.
        (vec![("\"sigma\": 0.01", "\"sigma\": 0")], "points without noise in p.json: cloud point 0, 0 m"),
        (
            vec![(
                "\"sigma\": 0.01",
                "\"sigma\": 0.01, \"sigma_xyz\": [[1e-2,1e-2,1e-2],[0.01,0,0.03],[0,0.01,0.01],[0.01,0.01,0.01],[0.01,0.01,0.01]]",
            )],
            "an axis without noise beside others in p.json: cloud point 1, [0.01, 0, 0.03] m; nothing is measured better",
        ),
        (
            vec![("\"sigma\": 0.01", "\"sigma\": 1e15"), no_prior],
            "noise larger than the model in p.json: σ = 1e15 m, and the model's box has 2.1",
        ),
        (
            vec![("0.04", "0.0009")],
            "`delta` is far below the noise in p.json: Δ = 9e-4 m, σ = 0.01 m; hardly a true pair",
        ),
        (
            vec![("\"shell_half_m\": 0.1", "\"shell_half_m\": 1e-30"), ("0.05]", "0]")],
            "`prior.shell_half_m` is far below the noise in p.json: 1e-30 m, σ = 0.01 m; hardly a true point",
        ),
        (
            vec![("\"shell_half_m\": 0.1", "\"shell_half_m\": 100")],
            "`prior.shell_half_m` leaves nothing out in p.json: 100 m, and half of the cloud lies in a box of",
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
            "the model points of `putative` lie on a line in p.json: 3 of 5, second extent over first 0.0e0; no pose",
        ),
        (
            vec![(row, "[2,0,3],[0.5"), ("null}", "[[0,0],[1,1],[2,2]]}")],
            "the cloud points of `putative` lie on a line in p.json: 3 of 5, second",
        ),
        // The prior.
        (vec![("0.05]", "1e300]")], "the prior puts the object far away in p.json: its nearest point is 1e300 m off"),
        (
            vec![("[0,0,1,3]", "[0,0,1,-3]")],
            "the prior puts the whole object behind the camera in p.json: its foremost point has z = -2 m; `T_cam_obj`",
        ),
        (
            vec![("0.05]", "5]")],
            "too few shells of the prior hold a cloud point in p.json: 0 of 5 model points; a pose",
        ),
        // The candidates.
        (
            vec![(CLOUD, &places(9000, |k| [k.sin(), (2.0 * k).sin(), k.cos() + 3.0])), no_prior],
            "too many candidate pairs in p.json: 45000, and `rigid-consensus` takes 40000; give a prior pose",
        ),
    ] {
        let reported = warnings(&changes);
        assert!(reported.len() == 1 && reported[0].starts_with(expected), "{expected}: {reported:?}");
        assert!(reported[0].len() < 300, "{reported:?}");
    }
}

/// Blunders far away, or a few more points on a line than others, are no reason to warn.
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

/// Shells that hold more pairs than can be listed: they are not listed.
#[test]
fn gates_that_hold_too_much_are_refused() {
    let cloud = places(2001, |k| [k.sin(), (2.0 * k).sin(), k.cos() + 3.0]);
    let model = places(2001, |k| [k, (3.0 * k).sin(), k.cos()]);
    let changes = [(CLOUD, cloud.as_str()), (MODEL, &model), ("\"shell_half_m\": 0.1", "\"shell_half_m\": 1e9")];
    let reported = warnings(&changes);
    let many =
        "too many candidate pairs in p.json: 4002000 at least, and `rigid-consensus` takes 40000; give a prior pose";
    assert!(reported.iter().any(|reported| reported.starts_with(many)), "{reported:?}");
    let sound = changes.map(|(from, to)| (from, if to.ends_with("1e9") { "\"shell_half_m\": 0.1" } else { to }));
    let reported = warnings(&sound);
    assert!(!reported.iter().any(|reported| reported.contains("candidate")), "{reported:?}");
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
    let sigmas = "\"sigma\": 0.01, \"sigma_xyz\": ";
    for (from, to, expected) in [
        ("problem/1", "problem/2", "unknown format in p.json:1:12: `coherence-problem/2`; this reader knows"),
        ("problem/1\"", "problem/1.1\", \"new\": 1", "unknown format in p.json:1:12: `coherence-problem/1.1`; this"),
        ("0.04", "-1", "`delta` is out of range in p.json:4:25: -1; allowed: above 0, at most"),
        ("0.04", "2.0", "`delta` is out of range in p.json:4:25: 2.0; allowed"),
        ("0.04", "1e300", "`delta` is out of range in p.json:4:25: 1e300; allowed"),
        // The third and the fourth point are 1.6202 m apart, the shell's diagonal is 2.19 m.
        (
            "0.04",
            "0.82",
            "`delta` is out of range in p.json:4:25: 0.82; allowed: above 0, at most half the model's diameter, 0.8101 m",
        ),
        ("0.01", "-0.01", "`sigma` is out of range in p.json:4:10: -0.01; give metres, zero to 1e15"),
        ("0.01", "1e300", "`sigma` is out of range in p.json:4:10: 1e300; give metres"),
        ("[0.5,0.5,1]", "[0.5, 1e10, 1]", "model point 3 is no part of an object in p.json:2:42: [0.5, 1e10, 1]; give"),
        (
            "null}",
            "[[0,5]]}",
            "putative pair 0 points nowhere in p.json:6:14: [0,5]; there are 5 model and 5 cloud points",
        ),
        (
            "\"sigma\": 0.01",
            &format!("{sigmas}[[1,1,1]]"),
            "`sigma_xyz` has the wrong length in p.json:4:29: 1 row for 5 cloud",
        ),
        (
            "\"sigma\": 0.01",
            &format!("{sigmas}[[1,1,1],[1,1,1],[1,1,1],[1,-1,1],[1,1,1]]"),
            "row 3 of `sigma_xyz` is out of range in p.json:4:54: [1,-1,1]; give metres",
        ),
        ("[[1,0,0,0.05]", "[[1.1,0,0,0.05]", "`prior.T_cam_obj` is no rigid motion: "),
        ("0.1}", "0}", "`prior.shell_half_m` is out of range in p.json:5:86: 0; give a positive half-size in metres"),
        (
            "{\"format\"",
            "[\"format\"",
            "a list where an object is expected in p.json:1:1: `[`; give one `coherence-problem/1` a file, in braces",
        ),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
    assert!(fault("[[1,0,0,0.05]", "[[1.1,0,0,0.05]").contains("in p.json:5:24: [[1.1,"));
    assert!(parse(&GOOD.replacen("0.04", "0.81", 1)).is_ok());
}

/// What is not what its key holds: the element, where it stands, what is written there, and what to give.
#[test]
fn every_value_of_another_kind_is_named() {
    let number = "; give a number, in metres";
    let row = "; give three numbers x y z, in metres";
    for (from, to, expected) in [
        ("[0.5,0.5,1]", "[0.5,\"a, b\",1]", format!("`model[3][1]` is no number in p.json:2:47: \"a, b\"{number}")),
        ("[0.5,0.5,4]", "[0.5,null,4]", format!("`cloud[3][1]` is no number in p.json:3:47: null{number}")),
        ("[0.5,0.5,1]", "[0.5,1e999,1]", format!("`model[3][1]` is beyond all numbers in p.json:2:47: 1e999{number}")),
        ("[0.5,0.5,1]", "[0.5,1]", format!("`model[3]` has 2 values in p.json:2:42: [0.5,1]{row}")),
        ("[0.5,0.5,1]", "[0.5,1,2,3]", format!("`model[3]` has 4 values in p.json:2:42: [0.5,1,2,3]{row}")),
        ("[0.5,0.5,1]", "7", format!("`model[3]` is no point in p.json:2:42: 7{row}")),
        ("0.01", "\"1 cm\"", "`sigma` is no number in p.json:4:10: \"1 cm\"; give the standard deviation".to_owned()),
        (
            "0.01",
            "0.01, \"sigma_xyz\": 1",
            "`sigma_xyz` is no list of rows in p.json:4:29: 1; give null, or".to_owned(),
        ),
        ("0.05", "\"x\"", "`prior.T_cam_obj[0][3]` is no number in p.json:5:32: \"x\"; give a number; the".to_owned()),
        (
            ",[0,0,0,1]]",
            "]",
            "`prior.T_cam_obj` has 3 values in p.json:5:24: [[1,0,0,0.05],[0,1,0,0],[0,0,1,3]]; give a 4×4".to_owned(),
        ),
        (
            "[[1,0,0,0.05]",
            "[[1,0,0]",
            "`prior.T_cam_obj[0]` has 3 values in p.json:5:25: [1,0,0]; give four".to_owned(),
        ),
        (
            GOOD_PRIOR,
            "[[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]],1]",
            "`prior` is no object in p.json:5:10: [[[1,0,0,0]".to_owned(),
        ),
        (
            "null}",
            "[[0,-1]]}",
            "`putative[0][1]` is no index in p.json:6:17: -1; give a whole number, from 0".to_owned(),
        ),
        ("null}", "[[0,0],[1.5,0]]}", "`putative[1][0]` is no index in p.json:6:21: 1.5; give a whole".to_owned()),
        (
            "null}",
            "[[0]]}",
            "`putative[0]` has 1 value in p.json:6:14: [0]; give two indices [model, cloud]".to_owned(),
        ),
        ("\"x\"", "5", "`id` is no text in p.json:1:41: 5; give a name in double quotes, or null".to_owned()),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(&expected), "{expected}\n{reported}");
    }
}

/// Keys that are missing, unknown or twice, and text that is no JSON.
#[test]
fn every_text_that_is_no_problem_is_reported_with_its_place() {
    for (from, to, expected) in [
        ("\"delta\"", "\"delat\"", "unknown key in p.json:4:16: `delat`; did you mean `delta`?"),
        ("\"delta\"", "\"a\"", "unknown key in p.json:4:16: `a`; there are format, id, "),
        ("\"delta\"", "\"del`ta\"", "unknown key in p.json:4:16: `del`ta`; did you mean `delta`?"),
        ("0.01, ", "0.01 m, ", "expected `,` or `}` in p.json:4:"),
        ("\"shell_half_m\"", "\"shell\"", "unknown key in p.json:5:70: `shell`; "),
        (
            "\"sigma\": 0.01, ",
            "",
            "`sigma` is missing in p.json:1:1; give the standard deviation of a measured coordinate",
        ),
        (", \"shell_half_m\": 0.1", "", "`prior.shell_half_m` is missing in p.json:5:10; give the half-size"),
        ("\"delta\"", "\"sigma\": 2, \"delta\"", "a key that is there twice in p.json:4:16: `sigma`; keep one"),
        ("[0.5,0.5,1]", "[0.5,NaN,1]", "`model[3][1]`: NaN is no JSON number in p.json:2:47; give a number, in metres"),
        ("[0.5,0.5,1]", "[0.5,-Infinity,1]", "`model[3][1]`: -Infinity is no JSON number in p.json:2:47; give a"),
        ("0.04", "nan", "`delta`: nan is no JSON number in p.json:4:25; give the tolerance of distances"),
        ("[0.5,0.5,1]", "[0.5,1.,1]", "`model[3][1]`: no JSON number in p.json:2:47: 1.; give a number"),
        ("[0.5,0.5,1]", "[0.5,0.5,1,]", "`model[3]`: a comma before the end in p.json:2:53: ]; remove it"),
        (
            "[0.5,0.5,1]",
            "[0.5,0.5 1]",
            "`model[3]`: expected `,` or `]` in p.json:2:51: 1; values are parted by commas",
        ),
        ("null}", "None}", "`putative`: no JSON value in p.json:6:13: None; give null, or a list of pairs"),
        ("\"putative\"", "putative", "a key without double quotes in p.json:6:1: putative; put it in double quotes"),
        (
            "\"x\"",
            "\"C:\\x\"",
            "`id`: no escape of JSON in p.json:1:45: x; write letters as they are, and a backslash twice",
        ),
        (
            "\"x\"",
            "\"a\tb\"",
            "`id`: a line break, tab or other control character in a text in p.json:1:42: a; write it as `\\n`",
        ),
        ("null}", "null} x", "something after the end of the problem in p.json:6:19: x; give one problem a file"),
        ("null}", "null", "the file ends too early in p.json:6:13; it seems to be cut off; write it again"),
        // The first of two faults, and no JSON behind it.
        ("[0.5,0.5,4],[-0.5,", "[0.5,\"q\",4],[NaN,", "`cloud[3][1]` is no number in p.json:3:48: q; give a number"),
        (
            "{\"format\"",
            "7{\"format\"",
            "no problem in p.json:1:1: 7; give one `coherence-problem/1` as JSON, in braces",
        ),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
    for (text, expected) in [
        (" \n", "an empty file in p.json; give one `coherence-problem/1` as JSON, in braces"),
        ("{}", "`format` is missing in p.json:1:1; give \"coherence-problem/1\""),
        ("{\"model\": [[0,0,0],\n[1,0", "`model[1]`: the file ends too early in p.json:2:4; it seems"),
    ] {
        let reported = parse(text).expect_err("it is no problem").to_string();
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
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

/// A displaced object: its shells hold nothing, those twice as large hold it, or none do and every point is looked at.
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
    assert!(refused.starts_with("too many points in `cloud` in p.json:3:10: 500006; at most 500000"), "{refused}");
}
