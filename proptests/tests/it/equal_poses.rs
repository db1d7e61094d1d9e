//! The default search: of two poses that explain the same points equally well none is answered.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_referencing::{
    Acceptance, Candidates, Gate, Mahalanobis, ModelPoint, Outcome, Prior, PriorBound, Problem, RigidConsensus,
    Tolerance, candidates, compute_fix, rms_apart,
};

/// The default's answer to a model of which the points from `first` on are seen, with clutter: whether it is a fix, and a wrong one.
///
/// With a gate (m) the prior is off by up to nine tenths of it.
fn answered(
    points: &[Vector3<f64>],
    first: usize,
    gate: Option<f64>,
    clutter: usize,
    rng: &mut ChaCha8Rng,
) -> (bool, bool) {
    const NOISE: f64 = 0.005;
    let model: Vec<ModelPoint> = points.iter().map(|at| ModelPoint::exact("", (*at).into())).collect();
    let cube = |rng: &mut ChaCha8Rng, half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
    let camera_from_object =
        Transform::<Camera, Object>::new(so3::exp(&cube(rng, 1.0)), cube(rng, 0.3) + Vector3::new(0.0, 0.0, 4.0));
    let mut places: Vec<Vector3<f64>> = Vec::new();
    for at in &points[first..] {
        // The sum of three has the variance of one and is nearly normal.
        let error = cube(rng, 1.0) + cube(rng, 1.0) + cube(rng, 1.0);
        places.push((camera_from_object * Point::from(*at)).coords + error * NOISE);
    }
    places.extend((0..clutter).map(|_| cube(rng, 1.0) + Vector3::new(0.0, 0.0, 4.0)));
    let cloud: Vec<MeasuredPoint> = places
        .iter()
        .map(|at| MeasuredPoint { position: UncertainPoint::isotropic((*at).into(), NOISE), pixels: None })
        .collect();
    let prior = gate.map(|half| {
        let moved = camera_from_object.translation() + cube(rng, 0.9 * half);
        let object_from_camera = Transform::<Camera, Object>::new(camera_from_object.rotation(), moved).inverse();
        Prior { object_from_camera, bound: PriorBound::Box(half) }
    });
    let candidates = match gate {
        Some(half) => candidates(&model, &cloud, prior.as_ref(), &Gate::Box(half), None),
        None => Candidates::all(model.len(), cloud.len()),
    };
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Fixed(0.03),
        prior: prior.as_ref(),
        edges: Default::default(),
    };
    let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
    let mut seed = ChaCha8Rng::seed_from_u64(0);
    let attempt = compute_fix(&problem, &search, &solver, &Acceptance::default(), None, &mut seed);
    match attempt.outcome {
        Outcome::Fix(fix) => (true, rms_apart(&model, &fix.object_from_camera, &camera_from_object.inverse()) > 0.1),
        _ => (false, false),
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
