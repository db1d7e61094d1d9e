//! A symmetric object has several poses, and no search chooses one of them.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Point, Transform};
use seafix_referencing::{
    Acceptance, Edges, End, Gate, ModelEdge, ModelPoint, Outcome, Prior, PriorBound, Problem, RigidConsensus,
    StereoReprojection, Tolerance, candidates, compute_fix, edge_candidates,
};

use super::{
    planted::{edge, searches},
    scene::{SIDES, corner, line, normal3, point, pose, rig},
};

/// A box turned by half a turn about an axis is the same box: without a prior its pose is ambiguous.
#[test]
fn a_plain_box_without_a_prior_gets_no_fix() {
    let rig = rig();
    let points: Vec<ModelPoint> =
        (0..8).map(|k| ModelPoint { sigma: 1e-3, ..ModelPoint::exact(format!("P{k}"), corner(k).into()) }).collect();
    let edges: Vec<ModelEdge> = SIDES
        .iter()
        .map(|ends| ModelEdge { id: format!("{ends:?}"), ends: ends.map(End::Point), sigma: 1e-3, faces: Vec::new() })
        .collect();
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = pose(2.0, 0.4 + seed as f64);
        let seen = |k: usize| truth.inverse() * Point::from(corner(k));
        let cloud: Vec<_> = (0..8).map(|k| point(&rig, &seen(k), 0.1, &mut rng)).collect();
        let lines: Vec<_> = SIDES.iter().map(|ends| line(&rig, ends.map(seen), 0.08, &mut rng)).collect();
        let lists = candidates(&points, &cloud, None, &Gate::default(), None);
        let of_edges = edge_candidates(&edges, &points, &lines, None, &Gate::default(), None);
        let problem = Problem {
            model: &points,
            cloud: &cloud,
            candidates: &lists,
            tolerance: Tolerance::Sigmas(3.0),
            prior: None,
            edges: Edges { model: &edges, lines: &lines, candidates: &of_edges },
        };
        for (name, search) in searches() {
            let (solver, acceptance) = (StereoReprojection::default(), Acceptance::default());
            let attempt = compute_fix(&problem, &*search, &solver, &acceptance, Some(&rig), &mut rng);
            assert!(!matches!(attempt.outcome, Outcome::Fix(_)), "{name}, seed {seed}: {}", attempt.outcome);
        }
    }
}

/// A prior of 1.5 m about a box of 0.5 m allows every attitude: a box of edges alone has several of them.
#[test]
fn a_plain_box_of_edges_under_a_wide_prior_gets_no_fix() {
    let rig = rig();
    let edges: Vec<ModelEdge> = SIDES.iter().map(|ends| edge(ends.map(|end| End::At(corner(end).into())))).collect();
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = pose(2.5, 0.3 + seed as f64);
        let seen = |k: usize| truth.inverse() * Point::from(corner(k));
        let lines: Vec<_> = SIDES[..9].iter().map(|ends| line(&rig, ends.map(seen), 0.05, &mut rng)).collect();
        let moved = Transform::new(truth.rotation(), truth.translation() + normal3(&mut rng, 0.3));
        let prior = Prior { object_from_camera: moved, bound: PriorBound::Box(1.5) };
        let lists = candidates(&[], &[], Some(&prior), &Gate::default(), None);
        let of_edges = edge_candidates(&edges, &[], &lines, Some(&prior), &Gate::default(), None);
        let problem = Problem {
            model: &[],
            cloud: &[],
            candidates: &lists,
            tolerance: Tolerance::Sigmas(3.0),
            prior: Some(&prior),
            edges: Edges { model: &edges, lines: &lines, candidates: &of_edges },
        };
        let (search, solver) = (RigidConsensus::default(), StereoReprojection::default());
        let attempt = compute_fix(&problem, &search, &solver, &Acceptance::default(), Some(&rig), &mut rng);
        assert!(!matches!(attempt.outcome, Outcome::Fix(_)), "seed {seed}: {}", attempt.outcome);
    }
}
