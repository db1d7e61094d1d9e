//! A plain box under a prior's box, and other structures in its place or beside it.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::Point;
use seafix_referencing::{
    Acceptance, Attempt, Edges, End, Gate, ModelEdge, ModelPoint, Outcome, Prior, PriorBound, Problem, RigidConsensus,
    StereoReprojection, Tolerance, candidates, compute_fix, edge_candidates,
};

use super::scene::{SIDES, corner, line, normal3, point, pose, rig};

type Segment = [Vector3<f64>; 2];

/// The visible sides of the box, stretched by these factors and moved.
fn sides(stretch: [f64; 3], by: Vector3<f64>) -> Vec<Segment> {
    SIDES[..9].iter().map(|ends| ends.map(|k| corner(k).component_mul(&Vector3::from(stretch)) + by)).collect()
}

/// The attempt at the box with some of its corners as points, where these segments are measured; the box of the prior has
/// this half-size (m).
fn attempt(corners: &[usize], scene: &[Segment], half: f64, seed: u64) -> Attempt {
    let (rig, truth, mut rng) = (rig(), pose(2.5, 0.3 + seed as f64), ChaCha8Rng::seed_from_u64(seed));
    let points: Vec<ModelPoint> =
        corners.iter().map(|&k| ModelPoint::exact(format!("P{k}"), corner(k).into())).collect();
    let edge = |(k, ends): (usize, &[usize; 2])| ModelEdge {
        id: format!("{k}"),
        ends: ends.map(|end| End::At(corner(end).into())),
        sigma: 5e-4,
        faces: Vec::new(),
    };
    let edges: Vec<ModelEdge> = SIDES.iter().enumerate().map(edge).collect();
    let seen = |at: Vector3<f64>| truth.inverse() * Point::from(at);
    let cloud: Vec<_> = corners.iter().map(|&k| point(&rig, &seen(corner(k)), 0.1, &mut rng)).collect();
    let visible = |ends: &&Segment| ends.iter().all(|end| rig.sees(&seen(*end), 0.0).is_some());
    let lines: Vec<_> = scene.iter().filter(visible).map(|ends| line(&rig, ends.map(seen), 0.05, &mut rng)).collect();
    let off = normal3(&mut rng, half / 5.0);
    let moved = seafix_geometry::Transform::new(truth.rotation(), truth.translation() + off);
    let prior = Prior { object_from_camera: moved, bound: PriorBound::Box(half) };
    let lists = candidates(&points, &cloud, Some(&prior), &Gate::default(), None);
    let of_edges = edge_candidates(&edges, &points, &lines, Some(&prior), &Gate::default(), None);
    let problem = Problem {
        model: &points,
        cloud: &cloud,
        candidates: &lists,
        tolerance: Tolerance::Sigmas(3.0),
        prior: Some(&prior),
        edges: Edges { model: &edges, lines: &lines, candidates: &of_edges },
    };
    let (solver, acceptance) = (StereoReprojection::default(), Acceptance::default());
    compute_fix(&problem, &RigidConsensus::default(), &solver, &acceptance, Some(&rig), &mut rng)
}

const ALONE: [f64; 3] = [1.0; 3];

/// The ends of edges stand for the points that an object of edges alone does not have: the prior bounds its attitude.
#[test]
fn a_prior_bounds_an_object_of_edges_alone() {
    for seed in 0..6 {
        let found = attempt(&[], &sides(ALONE, Vector3::zeros()), 0.2, seed);
        assert!(matches!(found.outcome, Outcome::Fix(_)), "seed {seed}: {}", found.outcome);
        // A grid on the floor has the directions of the box.
        let at = |k: i32| f64::from(k) * 0.1;
        let grid: Vec<Segment> = (-4..9)
            .flat_map(|k| {
                let [a, b, c, d] = [[at(k), -0.4], [at(k), 0.8], [-0.4, at(k)], [0.9, at(k)]];
                [[a, b], [c, d]].map(|ends| ends.map(|[x, y]| Vector3::new(x, y, 0.0)))
            })
            .collect();
        let absent = attempt(&[], &grid, 0.09, seed);
        assert!(!matches!(absent.outcome, Outcome::Fix(_)), "seed {seed}: {}", absent.outcome);
    }
}

/// A prior of 1.5 m about a box of 0.5 m allows every attitude, and a box turned by half a turn is the same box.
#[test]
fn a_plain_box_under_a_wide_prior_gets_no_fix() {
    for seed in 0..6 {
        let found = attempt(&[], &sides(ALONE, Vector3::zeros()), 1.5, seed);
        assert!(!matches!(found.outcome, Outcome::Fix(_)), "seed {seed}: {}", found.outcome);
    }
}

/// Some sides of another box beside the object fit the object too, but they are no second object.
#[test]
fn a_box_of_other_dimensions_beside_the_object_is_no_second_object() {
    for seed in 0..6 {
        let other = sides([1.0, 1.3, 0.8], Vector3::new(0.7, 0.0, 0.0));
        let scene = [sides(ALONE, Vector3::zeros()), other].concat();
        let found = attempt(&[1, 4, 5, 6, 7], &scene, 0.9, seed);
        assert!(matches!(found.outcome, Outcome::Fix(_)), "seed {seed}: {}", found.outcome);
    }
}
