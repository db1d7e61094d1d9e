//! Edges that reach far beyond the model points.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::Point;
use seafix_referencing::{
    Acceptance, Edges, End, Gate, ModelEdge, ModelPoint, Outcome, Prior, PriorBound, Problem, RigidConsensus,
    StereoReprojection, Tolerance, candidates, compute_fix, edge_candidates,
};

use super::{
    scene::{line, pose, rig},
    search::random_prior,
};

/// A lattice of 54 edges with three feature points at one corner.
///
/// A box about these points says little of the attitude, whose error moves the far end by more than the box is wide: no
/// displacement has more votes than another.
#[test]
fn a_lattice_with_points_at_one_corner_is_found() {
    let (rig, step) = (rig(), 0.45);
    let place = |k: [usize; 3]| Vector3::from_fn(|axis, _| k[axis] as f64 * step);
    let nodes = || (0..27).map(|k| [k / 9, k / 3 % 3, k % 3]);
    let beside = |k: [usize; 3], axis: usize| {
        let mut next = k;
        next[axis] += 1;
        (next[axis] < 3).then_some([place(k), place(next)])
    };
    let ends: Vec<[Vector3<f64>; 2]> = nodes().flat_map(|k| (0..3).filter_map(move |axis| beside(k, axis))).collect();
    let edge = |ends: &[Vector3<f64>; 2]| ModelEdge {
        id: format!("{ends:?}"),
        ends: ends.map(|end| End::At(Point::from(end))),
        sigma: 0.0,
        faces: Vec::new(),
    };
    let edges: Vec<ModelEdge> = ends.iter().map(edge).collect();
    let points: Vec<ModelPoint> =
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]].map(|k| ModelPoint::exact(format!("{k:?}"), place(k).into())).to_vec();
    for seed in 0..3 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = pose(4.0, seed as f64);
        let near = random_prior(&truth, (0.0087, 0.1), &mut rng);
        let prior = Prior { bound: PriorBound::Box(0.3), ..near };
        let into = truth.inverse();
        let lines: Vec<_> = ends
            .iter()
            .map(|ends| ends.map(|end| into * Point::from(end)))
            .filter(|ends| ends.iter().all(|end| rig.sees(end, 0.0).is_some()))
            .map(|ends| line(&rig, ends, 0.08, &mut rng))
            .collect();
        let lists = candidates(&points, &[], Some(&prior), &Gate::default(), None);
        let of_edges = edge_candidates(&edges, &points, &lines, Some(&prior), &Gate::default(), None);
        let problem = Problem {
            model: &points,
            cloud: &[],
            candidates: &lists,
            tolerance: Tolerance::Sigmas(3.0),
            prior: Some(&prior),
            edges: Edges { model: &edges, lines: &lines, candidates: &of_edges },
        };
        let (search, solver, acceptance) =
            (RigidConsensus::default(), StereoReprojection::default(), Acceptance::default());
        let attempt = compute_fix(&problem, &search, &solver, &acceptance, Some(&rig), &mut rng);
        let Outcome::Fix(fix) = &attempt.outcome else { panic!("seed {seed}: {}", attempt.outcome) };
        let error = (truth.inverse() * fix.object_from_camera).translation().norm();
        assert!(error < 0.02, "seed {seed}: {error} m");
    }
}
