//! Problems with edges.

use super::*;

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

/// A problem without a single measured point has a fix by its edges.
#[test]
fn edges_alone_give_a_fix() {
    let problem = parse(&wireframe(FORMAT_WITH_EDGES)).unwrap();
    assert_eq!((problem.edges.model.len(), problem.edges.lines.len()), (12, 12));
    assert!(problem.warnings(Path::new("p.json")).is_empty(), "{:?}", problem.warnings(Path::new("p.json")));
    let acceptance = Acceptance::default();
    let solver = SOLVERS.build(&Choice::named("mahalanobis")).unwrap();
    let method = Method {
        search: ("rigid-consensus", &RigidConsensus::default()),
        solver: ("mahalanobis", &*solver),
        acceptance: &acceptance,
        expand_gates: false,
    };
    let answer = answer(&problem, Path::new("p.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
    assert_eq!((answer.outcome, &answer.edges), ("fix", &(0..12).map(|i| [i, i]).collect::<Vec<_>>()), "{answer:?}");
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
