//! The default search: of two poses that explain the same points equally well none is answered.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_referencing::{
    Acceptance, Candidates, Gate, Mahalanobis, ModelPoint, Outcome, Prior, PriorBound, Problem, RigidConsensus,
    Tolerance, candidates, compute_fix, rms_apart,
};

const NOISE: f64 = 0.005;

fn cube(rng: &mut ChaCha8Rng, half: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-half..half))
}

/// An error of one standard deviation: the sum of three has the variance of one and is nearly normal.
fn error(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    (cube(rng, 1.0) + cube(rng, 1.0) + cube(rng, 1.0)) * NOISE
}

fn exact(points: &[Vector3<f64>]) -> Vec<ModelPoint> {
    points.iter().map(|at| ModelPoint::exact("", (*at).into())).collect()
}

/// The default's fix of a model in a cloud of these places (m, camera frame).
///
/// Candidates are all points, those in the gate of a prior, or the pairs given.
fn fix(
    model: &[ModelPoint],
    places: &[Vector3<f64>],
    prior: Option<&Prior>,
    pairs: Option<&[(usize, usize)]>,
) -> Option<Transform<Object, Camera>> {
    let measured =
        |at: &Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic((*at).into(), NOISE), pixels: None };
    let cloud: Vec<MeasuredPoint> = places.iter().map(measured).collect();
    let candidates = match (prior.map(|prior| &prior.bound), pairs) {
        (_, Some(pairs)) => Candidates::from_pairs(model.len(), pairs.iter().copied()),
        (Some(PriorBound::Box(half)), _) => candidates(model, &cloud, prior, &Gate::Box(*half), None),
        _ => Candidates::all(model.len(), cloud.len()),
    };
    let problem = Problem {
        model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Fixed(6.0 * NOISE),
        prior,
        edges: Default::default(),
    };
    let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
    let mut seed = ChaCha8Rng::seed_from_u64(0);
    match compute_fix(&problem, &search, &solver, &Acceptance::default(), None, &mut seed).outcome {
        Outcome::Fix(fix) => Some(fix.object_from_camera),
        _ => None,
    }
}

/// A pose about 4 m before the camera.
fn pose(rng: &mut ChaCha8Rng) -> Transform<Camera, Object> {
    Transform::new(so3::exp(&cube(rng, 1.0)), cube(rng, 0.3) + Vector3::new(0.0, 0.0, 4.0))
}

/// A prior with a gate (m) whose position is off by up to `off` of it on each axis.
fn prior(rng: &mut ChaCha8Rng, camera_from_object: &Transform<Camera, Object>, half: f64, off: f64) -> Prior {
    let moved = camera_from_object.translation() + cube(rng, off * half);
    let object_from_camera = Transform::<Camera, Object>::new(camera_from_object.rotation(), moved).inverse();
    Prior { object_from_camera, bound: PriorBound::Box(half) }
}

/// The default's answer to a model of which the points from `first` on are seen, with clutter: whether it is a fix, and a
/// wrong one.
///
/// With a gate (m) the prior is off by up to nine tenths of it.
fn answered(
    points: &[Vector3<f64>],
    first: usize,
    gate: Option<f64>,
    clutter: usize,
    rng: &mut ChaCha8Rng,
) -> (bool, bool) {
    let model = exact(points);
    let camera_from_object = pose(rng);
    let mut places: Vec<Vector3<f64>> =
        points[first..].iter().map(|at| (camera_from_object * Point::from(*at)).coords + error(rng)).collect();
    places.extend((0..clutter).map(|_| cube(rng, 1.0) + Vector3::new(0.0, 0.0, 4.0)));
    let prior = gate.map(|half| prior(rng, &camera_from_object, half, 0.9));
    match fix(&model, &places, prior.as_ref(), None) {
        Some(found) => (true, rms_apart(&model, &found, &camera_from_object.inverse()) > 0.1),
        None => (false, false),
    }
}

/// Of a ladder of five bays four are seen: it may be one bay further. The prior often admits both places.
///
/// Seen to fail when a pose as probable as the best is compared with it only as clutter.
#[test]
fn a_ladder_is_not_answered_one_bay_off() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut fixes = 0;
    for draw in 0..60 {
        let bay: Vec<Vector3<f64>> = (0..30).map(|_| Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2))).collect();
        let bays = (0..5).map(|k| Vector3::new(0.5 * f64::from(k), 0.0, 0.0));
        let model: Vec<Vector3<f64>> = bays.flat_map(|step| bay.iter().map(move |at| at + step)).collect();
        let (fix, wrong) = answered(&model, bay.len(), Some(0.7), 20, &mut rng);
        assert!(!wrong, "draw {draw}");
        fixes += usize::from(fix);
    }
    assert!(fixes > 0, "the prior decides in some");
}

/// Points in pairs four standard deviations apart, with their images by half a turn: both poses explain all of them.
///
/// Seen to fail when an image is dropped whose two points of a pair have the same nearest model point.
#[test]
fn half_a_turn_of_points_side_by_side_is_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for draw in 0..20 {
        let mut half: Vec<Vector3<f64>> = Vec::new();
        for _ in 0..6 {
            let at = Vector3::from_fn(|_, _| rng.random_range(-0.4..0.4));
            let beside = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize() * 0.02;
            half.extend([at, at + beside]);
        }
        let model: Vec<Vector3<f64>> =
            half.iter().copied().chain(half.iter().map(|at| Vector3::new(-at.x, -at.y, at.z))).collect();
        let (fix, _) = answered(&model, 0, None, 5, &mut rng);
        assert!(!fix, "draw {draw}");
    }
}

/// Five points of the object, the nearest to each other or any, and twelve of a second copy. Of the draws in which each
/// part by itself is a fix, at most one in ten is a fix with both: the other part's evidence is then near the limit.
///
/// Seen to fail, with one in five, when copies are searched from nine nats on, since a set of points close together
/// exceeds its bound.
#[test]
fn two_parts_that_are_each_a_fix_are_not_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for close in [true, false] {
        let (mut both, mut answered) = (0, 0);
        for _ in 0..150 {
            let half = Vector3::new(0.8, 0.6, 0.5);
            let points: Vec<Vector3<f64>> = (0..16).map(|_| cube(&mut rng, 1.0).component_mul(&half)).collect();
            let (model, camera_from_object) = (exact(&points), pose(&mut rng));
            let moved = Transform::<Object, Object>::new(so3::exp(&cube(&mut rng, 2.0)), cube(&mut rng, 2.0));
            let mut order: Vec<usize> = (0..16).collect();
            if close {
                order.sort_by(|a, b| (points[*a] - points[0]).norm().total_cmp(&(points[*b] - points[0]).norm()));
            }
            let mut see = |of: &[usize], from: &Transform<Camera, Object>| -> Vec<Vector3<f64>> {
                of.iter().map(|&i| (*from * Point::from(points[i])).coords + error(&mut rng)).collect()
            };
            let own = see(&order[..5], &camera_from_object);
            let other = see(&(4..16).collect::<Vec<_>>(), &(camera_from_object * moved));
            let all = [own.clone(), other.clone()].concat();
            let clutter: Vec<Vector3<f64>> =
                (0..10).map(|_| all[rng.random_range(0..all.len())] + cube(&mut rng, 0.5)).collect();
            // Each part by itself, among as many other points over the same volume.
            let mut by_itself = |part: &[Vector3<f64>], rest: &[Vector3<f64>]| {
                let (min, max) = rest.iter().fold((rest[0], rest[0]), |(min, max), at| (min.inf(at), max.sup(at)));
                let scattered = rest.iter().map(|_| min.zip_map(&max, |min, max| rng.random_range(min..max)));
                let places = [part, &clutter, &scattered.collect::<Vec<_>>()].concat();
                fix(&model, &places, None, None).is_some()
            };
            if by_itself(&own, &other) && by_itself(&other, &own) {
                both += 1;
                answered += usize::from(fix(&model, &[all, clutter].concat(), None, None).is_some());
            }
        }
        assert!(both >= 75 && 10 * answered <= both, "close {close}: {answered} of {both}");
    }
}

/// Three equal parts in a row, and a matcher that proposes for each point its likes in all parts: with the ends in view
/// the measured places decide between the shifts of the row.
///
/// Seen to fail, with no fix, when pairs at random are weighed without the places that the shifts leave empty.
#[test]
fn proposals_that_hold_all_points_alike_are_answered_where_the_row_ends() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut fixes = 0;
    for draw in 0..40 {
        let part: Vec<Vector3<f64>> = (0..4).map(|_| cube(&mut rng, 0.3)).collect();
        let parts = (0..3).map(|k| Vector3::new(0.8 * f64::from(k), 0.0, 0.0));
        let points: Vec<Vector3<f64>> = parts.flat_map(|step| part.iter().map(move |at| at + step)).collect();
        let (model, camera_from_object) = (exact(&points), pose(&mut rng));
        let places: Vec<Vector3<f64>> =
            points.iter().map(|at| (camera_from_object * Point::from(*at)).coords + error(&mut rng)).collect();
        let pairs: Vec<(usize, usize)> =
            (0..12).flat_map(|cloud| (0..3).map(move |k| (4 * k + cloud % 4, cloud))).collect();
        let Some(found) = fix(&model, &places, None, Some(&pairs)) else { continue };
        fixes += 1;
        assert!(rms_apart(&model, &found, &camera_from_object.inverse()) <= 0.1, "draw {draw}");
    }
    assert!(fixes >= 35, "{fixes} of 40");
}

/// Five places with two points each, and all points measured twice: the second measurements are no other object.
///
/// Seen to fail when only the points that the best pose identifies are left out of the search for copies.
#[test]
fn points_measured_twice_are_no_second_object() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let mut fixes = 0;
    for draw in 0..60 {
        let first: Vec<Vector3<f64>> = (0..5).map(|_| cube(&mut rng, 0.7)).collect();
        let second: Vec<Vector3<f64>> =
            first.iter().map(|at| at + cube(&mut rng, 1.0).normalize() * 4.0 * NOISE).collect();
        let points = [first, second].concat();
        let (model, camera_from_object) = (exact(&points), pose(&mut rng));
        let mut seen: Vec<Vector3<f64>> =
            points[..8].iter().map(|at| (camera_from_object * Point::from(*at)).coords).collect();
        seen.extend((0..15).map(|_| cube(&mut rng, 1.0) + Vector3::new(0.0, 0.0, 4.0)));
        let places: Vec<Vector3<f64>> = seen.iter().flat_map(|at| [*at, *at]).map(|at| at + error(&mut rng)).collect();
        let prior = prior(&mut rng, &camera_from_object, 0.4, 0.6);
        let Some(found) = fix(&model, &places, Some(&prior), None) else { continue };
        fixes += 1;
        assert!(rms_apart(&model, &found, &camera_from_object.inverse()) <= 0.1, "draw {draw}");
    }
    assert!(fixes >= 57, "{fixes} of 60");
}
