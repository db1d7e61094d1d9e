//! Problems with edges.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::Transform;

use super::*;
use crate::site::edge::End;

/// The twelve edges of a box of 1.2 × 0.8 × 0.5 m, a point list of three corners, and the lines of the edges that a camera
/// 3 m in front of it measures, with errors of a millimetre or less.
fn wireframe(format: &str) -> String {
    let corner = |c: usize| [0, 1, 2].map(|axis| if c >> axis & 1 == 1 { [1.2, 0.8, 0.5][axis] } else { 0.0 });
    let pairs = (0..8).flat_map(|a| [1, 2, 4].map(|step| (a, a | step))).filter(|(a, b)| a != b);
    let (mut edges, mut lines) = (Vec::new(), Vec::new());
    for (index, (a, b)) in pairs.enumerate() {
        let [from, to] = [corner(a), corner(b)];
        edges.push(match a {
            0 => format!("[0, {to:?}]"),
            _ => format!("[{from:?}, {to:?}]"),
        });
        // The camera sees the edge from a tenth to nine tenths, a little beside its place.
        let off = 1e-3 * ((index * 7 % 5) as f64 / 2.0 - 1.0);
        let at = |t: f64| [0, 1, 2].map(|axis| from[axis] + t * (to[axis] - from[axis]) + [off, -off, 3.0 + off][axis]);
        let covariance = "[[1e-6,0,0,0],[0,1e-6,0,0],[0,0,1e-6,0],[0,0,0,1e-6]]";
        lines.push(format!("{{\"ends\": [{:?}, {:?}], \"covariance\": {covariance}}}", at(0.1), at(0.9)));
    }
    format!(
        "{{\"format\": \"{format}\", \"model\": [[0,0,0],[1.2,0,0],[0,0.8,0]], \"cloud\": [], \"sigma\": 0.001, \
         \"delta\": 0.01, \"prior\": {{\"T_cam_obj\": [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], \
         \"shell_half_m\": 0.2}}, \"edges\": [{}], \"lines\": [{}]}}",
        edges.join(", "),
        lines.join(", ")
    )
}

fn answered(problem: &CoherenceProblem) -> Answer {
    let acceptance = Acceptance::default();
    let solver = SOLVERS.build(&Choice::named("mahalanobis")).unwrap();
    let method = Method {
        search: ("rigid-consensus", &RigidConsensus::default()),
        solver: ("mahalanobis", &*solver),
        acceptance: &acceptance,
        expand_gates: false,
    };
    answer(problem, Path::new("p.json"), &method, &mut ChaCha8Rng::seed_from_u64(0))
}

/// Generated problems: a box with a smaller one on it, among other lines.
#[test]
fn generated_problems_have_their_answers() {
    let all = [
        // A structure of the object's kind is no second object.
        (include_str!("box_beside.json"), "fix"),
        // Without model points, a prior is about the ends of edges.
        (include_str!("panel_lines.json"), "fix"),
        (include_str!("floor_grid.json"), "rejected"),
        // No predicted edge overlaps its line.
        (include_str!("wide_prior.json"), "fix"),
    ];
    for (text, outcome) in all {
        let problem = parse(text).unwrap();
        let answer = answered(&problem);
        assert_eq!(answer.outcome, outcome, "{}: {answer:?}", problem.id);
    }
}

/// A problem without a single measured point has a fix by its edges.
#[test]
fn edges_alone_give_a_fix() {
    let problem = parse(&wireframe(FORMAT_WITH_EDGES)).unwrap();
    assert_eq!((problem.edges.model.len(), problem.edges.lines.len()), (12, 12));
    let answer = answered(&problem);
    assert_eq!((answer.outcome, &answer.edges), ("fix", &(0..12).map(|i| [i, i]).collect::<Vec<_>>()), "{answer:?}");
    assert_eq!((answer.consensus_bound, answer.lines_behind.len()), (Some(12), 0), "edges count as points do");
    let pose = answer.t_cam_obj.unwrap();
    let error = [pose[0][3], pose[1][3], pose[2][3] - 3.0].map(f64::abs).into_iter().fold(0.0, f64::max);
    assert!(error < 2e-3, "{error}");
}

#[test]
fn edges_need_the_format_that_has_them() {
    let fault = parse(&wireframe(FORMAT)).unwrap_err().to_string();
    assert!(fault.contains("edges in a problem of another format"), "{fault}");
    assert!(fault.contains("give `coherence-problem/1.1`"), "{fault}");
    let fault = parse(&wireframe(FORMAT_WITH_EDGES).replace("[0, [1.2", "[9, [1.2")).unwrap_err().to_string();
    assert!(fault.contains("edge 0 ends at no model point"), "{fault}");
}

/// Each value of another type is named with its place and with what is expected there.
#[test]
fn wrong_types_of_edges_and_lines_are_named() {
    let good = wireframe(FORMAT_WITH_EDGES);
    for (from, to, fault) in [
        ("[0, [1.2", "[-1, [1.2", "`edges[0][0]` is not an end of an edge"),
        ("[0, [1.2, 0.0, 0.0]]", "[0, [1.2, 0.0]]", "`edges[0][1]` is not an end of an edge"),
        ("[0, [1.2, 0.0, 0.0]]", "{\"from\": 0}", "`edges[0]` is not an edge"),
        ("\"ends\": [[", "\"ends\": [[\"x\", ", "`lines[0].ends[0][0]` is not a number"),
        ("[[1e-6,0,0,0],[0,1e-6,0,0],[0,0,1e-6,0],[0,0,0,1e-6]]", "null", "`lines[0].covariance` is not a matrix"),
        ("\"lines\": [", "\"lines\": [[1], ", "`lines[0]` is not a line"),
        ("\"edges\":", "\"putative_edges\": [[0, -1]], \"edges\":", "`putative_edges[0][1]` is not an index"),
    ] {
        assert!(good.contains(from), "{from}");
        let text = parse(&good.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(text.starts_with(fault) && text.lines().count() == 1, "{text}");
    }
}

/// The answers to a problem without points speak of its edges, and bound their number.
#[test]
fn a_rejection_counts_edges() {
    let wrong = (0..6).map(|i| (i, 11 - i)).collect();
    for (pairs, expected) in [
        (vec![(0, 0)], "too few candidates: 0 model points and 1 edge with a candidate; a pose needs three"),
        (vec![(0, 0), (1, 1)], "too few identified points and edges: 2 found, 3 required"),
        (vec![(0, 0), (1, 1), (2, 2)], "; 0 of 3 points and 3 of 12 edges identified"),
        (
            wrong,
            "no pose found: the search met no set of points and edges that one pose explains; at most 6 are possible",
        ),
    ] {
        let mut problem = parse(&wireframe(FORMAT_WITH_EDGES)).unwrap();
        let bound = pairs.len();
        problem.edges.putative = Some(pairs);
        let answer = answered(&problem);
        let text = answer.explanation.unwrap();
        assert!(text.ends_with(expected) && answer.consensus_bound == Some(bound), "{text}\n{expected}");
    }
}

/// A fix names its lines behind the camera as it does its points.
#[test]
fn identified_lines_behind_the_camera_are_named() {
    let mut problem = parse(&wireframe(FORMAT_WITH_EDGES)).unwrap();
    problem.edges.lines.iter_mut().flat_map(|line| &mut line.ends).for_each(|end| end.coords.z -= 3.2);
    problem.prior.as_mut().unwrap().object_from_camera =
        Transform::new(UnitQuaternion::identity(), Vector3::new(-0.05, 0.0, 0.2));
    let answer = answered(&problem);
    assert_eq!((answer.outcome, answer.lines_behind.len()), ("fix", 8), "{answer:?}");
}

/// Valid but implausible edges and lines are warned of in one line.
#[test]
fn implausible_edges_and_lines_are_warned_of() {
    type Change = fn(&mut CoherenceProblem);
    let warned = |change: Change| -> Vec<String> {
        let mut problem = parse(&wireframe(FORMAT_WITH_EDGES)).unwrap();
        change(&mut problem);
        let warnings = problem.warnings(Path::new("p.json"));
        warnings.iter().map(ToString::to_string).filter(|text| !text.starts_with("the cloud has no points")).collect()
    };
    assert!(warned(|_| {}).is_empty(), "{:?}", warned(|_| {}));
    let table: [(Change, &str); 6] = [
        (|it| it.edges.lines.clear(), "edges without lines in p.json: 12 edges; "),
        (|it| it.edges.model.clear(), "lines without edges in p.json: 12 lines; "),
        (
            |it| it.edges.lines[3].ends[1].coords.z = -1.0,
            "lines behind the camera (z ≤ 0) in p.json: 1 of 12, e.g. line 3; ",
        ),
        (|it| it.edges.lines[3].offsets *= 1e36, "lines with more noise than length in p.json: 1 of 12, e.g. line 3; "),
        (|it| it.edges.lines.push(it.edges.lines[5]), "repeated lines in p.json: 1 of 13, e.g. line 12; "),
        (
            |it| it.edges.model[1].ends[1] = End::At([1200.0, 0.0, 0.0].into()),
            "implausible units in p.json: the longest edge has ",
        ),
    ];
    for (change, expected) in table {
        let warnings = warned(change);
        assert!(warnings.len() == 1 && warnings[0].starts_with(expected), "{expected}\n{warnings:?}");
    }
}
