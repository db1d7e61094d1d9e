use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Covariance6, Point, Transform, UncertainPoint};

use super::*;
use crate::{
    candidates::Candidates,
    problem::{Prior, PriorBound, Tolerance},
    search::mirrored,
    site::model::ModelPoint,
};
use seafix_geometry::MeasuredPoint;

const PLACES: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [1.3, 0.0, 0.0],
    [0.3, -0.9, 0.0],
    [0.8, 0.6, 0.5],
    [-0.4, 0.7, 0.9],
    [0.1, -0.3, 1.2],
    [0.65, 0.01, 0.01], // nearly on a line with the first two
];

/// A frame without its object.
struct Frame {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
    prior: Option<Prior>,
}

fn model() -> Vec<ModelPoint> {
    PLACES.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect()
}

fn measured(at: Vector3<f64>, sigmas: [f64; 3]) -> MeasuredPoint {
    let covariance = Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s)));
    MeasuredPoint { position: UncertainPoint { at: at.into(), covariance }, pixels: None }
}

fn within(half: f64, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-half..half))
}

/// Independent points in a box about each prediction.
fn gates(half: f64, each: usize, sigmas: [f64; 3], rng: &mut ChaCha8Rng) -> Frame {
    let cloud = (0..PLACES.len() * each)
        .map(|j| measured(Vector3::from(PLACES[j / each]) + within(half, rng), sigmas))
        .collect();
    let candidates = Candidates { lists: (0..PLACES.len()).map(|i| (each * i..each * (i + 1)).collect()).collect() };
    let prior = Prior { object_from_camera: Transform::identity(), bound: PriorBound::Box(half) };
    Frame { model: model(), cloud, candidates, prior: Some(prior) }
}

/// Points anywhere in a box, and every pair a candidate.
fn anywhere(half: f64, m: usize, rng: &mut ChaCha8Rng) -> Frame {
    let cloud = (0..m).map(|_| measured(within(half, rng), [0.01; 3])).collect();
    Frame { model: model(), cloud, candidates: Candidates::all(PLACES.len(), m), prior: None }
}

/// Putative pairs with shuffled partners, half of them in a corner.
fn putative(n: usize, rng: &mut ChaCha8Rng) -> Frame {
    let model = (0..n).map(|_| ModelPoint::exact("", within(0.6, rng).into())).collect();
    let cloud = (0..n).map(|j| measured(within(if j % 2 == 0 { 0.6 } else { 2.0 }, rng), [0.01; 3])).collect();
    let candidates = Candidates { lists: (0..n).map(|i| vec![i]).collect() };
    Frame { model, cloud, candidates, prior: None }
}

impl Frame {
    fn problem(&self, tolerance: f64) -> Problem<'_> {
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: Tolerance::Fixed(tolerance),
            prior: self.prior.as_ref(),
            edges: Default::default(),
        }
    }
}

/// The number of admissible sets of `size` pairs or more with at most this χ² per degree of freedom, by enumeration.
fn count(problem: &Problem<'_>, size: usize, each: f64) -> usize {
    fn grow(problem: &Problem<'_>, size: usize, each: f64, from: usize, set: &mut Vec<Correspondence>) -> usize {
        let good = |set: &[Correspondence]| set.len() >= size && best(problem, set).0 <= each * dof(set.len());
        let mut found = usize::from(good(set));
        for model in from..problem.model.len() {
            for &cloud in &problem.candidates.lists[model] {
                let pair = Correspondence { model, cloud };
                let fits = set.iter().all(|&other| problem.coherent(pair, other));
                let proper = |three: &[Correspondence; 3]| !mirrored(problem, [three[0], three[1], three[2], pair]);
                if fits && threes(set).iter().all(proper) {
                    set.push(pair);
                    found += grow(problem, size, each, model + 1, set);
                    set.pop();
                }
            }
        }
        found
    }
    grow(problem, size, each, 0, &mut Vec::new())
}

fn threes(set: &[Correspondence]) -> Vec<[Correspondence; 3]> {
    let n = set.len();
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    pairs.flat_map(|(i, j)| (j + 1..n).map(move |k| [set[i], set[j], set[k]])).collect()
}

/// Ratio of observed to predicted numbers in `frames` frames.
fn ratio(size: usize, each: f64, tolerance: f64, frames: usize, mut frame: impl FnMut() -> Frame) -> f64 {
    let (mut expected, mut counted) = (0.0, 0);
    for _ in 0..frames {
        let frame = frame();
        let problem = frame.problem(tolerance);
        expected += nfa(&problem, size, each * dof(size));
        counted += count(&problem, size, each);
    }
    counted as f64 / expected
}

#[test]
fn candidates_in_gates() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for (size, each, frames) in [(3, 0.3, 200), (3, 1.5, 50), (3, 5.0, 50), (4, 3.0, 1000)] {
        let ratio = ratio(size, each, 0.0424, frames, || gates(0.3, 8, [0.01; 3], &mut rng));
        assert!((0.7..1.4).contains(&ratio), "size {size}, chi2/dof {each}: {ratio} times");
    }
}

#[test]
fn depth_known_less_well() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    for (size, each, frames) in [(3, 1.0, 50), (4, 2.0, 500)] {
        let ratio = ratio(size, each, 0.06, frames, || gates(0.3, 8, [0.008, 0.008, 0.024], &mut rng));
        assert!((0.7..1.4).contains(&ratio), "size {size}, chi2/dof {each}: {ratio} times");
    }
}

#[test]
fn candidates_anywhere() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for (size, each, frames) in [(3, 1.0, 15), (3, 5.0, 5)] {
        let ratio = ratio(size, each, 0.0424, frames, || anywhere(1.0, 40, &mut rng));
        assert!((0.7..1.4).contains(&ratio), "size {size}, chi2/dof {each}: {ratio} times");
    }
}

/// The same frame with its points in a random order.
fn renumbered(frame: &Frame, rng: &mut ChaCha8Rng) -> Frame {
    let mut shuffled = |n: usize| {
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(rng);
        order
    };
    let (models, clouds) = (shuffled(frame.model.len()), shuffled(frame.cloud.len()));
    let mut new = vec![0; clouds.len()];
    clouds.iter().enumerate().for_each(|(k, &j)| new[j] = k);
    let renamed = |list: &Vec<usize>| {
        let mut list: Vec<usize> = list.iter().map(|&j| new[j]).collect();
        list.sort_unstable();
        list
    };
    Frame {
        model: models.iter().map(|&i| frame.model[i].clone()).collect(),
        cloud: clouds.iter().map(|&j| frame.cloud[j]).collect(),
        candidates: Candidates { lists: models.iter().map(|&i| renamed(&frame.candidates.lists[i])).collect() },
        prior: frame.prior.clone(),
    }
}

/// The NFA does not depend on the numbering of the points.
#[test]
fn an_order_of_the_points_is_as_good_as_another() {
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let gaussian = |frame: Frame| {
        let bound = PriorBound::Gaussian(Covariance6::isotropic(0.1, 0.1));
        Frame { prior: frame.prior.map(|prior| Prior { bound, ..prior }), ..frame }
    };
    let frames = [
        gates(0.3, 8, [0.008, 0.008, 0.024], &mut rng),
        gaussian(gates(0.3, 12, [0.01; 3], &mut rng)),
        anywhere(1.0, 40, &mut rng),
        putative(60, &mut rng),
        putative(500, &mut rng),
    ];
    for (number, frame) in frames.iter().enumerate() {
        for size in [3, 5] {
            let expected = nfa(&frame.problem(0.05), size, dof(size));
            for _ in 0..5 {
                let other = renumbered(frame, &mut rng);
                let again = nfa(&other.problem(0.05), size, dof(size));
                assert!((again / expected - 1.0).abs() < 1e-9, "frame {number}, size {size}: {expected}, {again}");
            }
        }
    }
}

/// The NFA of shuffled partners does not depend on the origin of the camera's frame.
///
/// Fails if partners are selected by a hash of their coordinates.
#[test]
fn a_translation_of_the_cloud_changes_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(18);
    for n in [60, 500] {
        let frame = putative(n, &mut rng);
        let expected = nfa(&frame.problem(0.05), 3, dof(3));
        for _ in 0..5 {
            let step = within(8.0, &mut rng);
            let moved = |point: &MeasuredPoint| measured(point.position.at.coords + step, [0.01; 3]);
            let (cloud, candidates) = (frame.cloud.iter().map(moved).collect(), frame.candidates.clone());
            let moved = Frame { model: frame.model.clone(), cloud, candidates, prior: None };
            let again = nfa(&moved.problem(0.05), 3, dof(3));
            assert!((again / expected - 1.0).abs() < 1e-9, "{n} pairs: {expected}, {again}");
        }
    }
}

#[test]
fn partners_shuffled() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let ratio = ratio(3, 3.0, 0.0424, 200, || putative(60, &mut rng));
    assert!((0.7..1.4).contains(&ratio), "{ratio} times");
}

#[test]
fn few_pairs_and_impossible_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let mut frame = gates(0.3, 2, [0.01; 3], &mut rng);
    let pairs: Vec<Correspondence> = (0..3).map(|i| Correspondence { model: i, cloud: 2 * i }).collect();
    assert_eq!(expected_sets(&frame.problem(0.05), &pairs[..2]), f64::INFINITY);
    assert!(expected_sets(&frame.problem(0.05), &pairs).is_finite());
    // A better residual is rarer by chance.
    let better = nfa(&frame.problem(0.05), 3, 0.1);
    assert!(better < 0.2 * nfa(&frame.problem(0.05), 3, 1.0));
    frame.cloud[0].position.covariance[(0, 0)] = f64::NAN;
    assert!(expected_sets(&frame.problem(0.05), &pairs).is_nan());
    assert!(expected_sets_as_good(&frame.problem(0.05), &pairs).is_nan());
}

/// Only the object is measured, so that the cloud's box is the object's: no sampled rotation fits.
///
/// Fails if a set that fits no sampled rotation counts as impossible.
#[test]
fn an_object_that_fills_its_cloud_is_no_impossible_accident() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..20 {
        let turn = nalgebra::Rotation3::from_scaled_axis(within(3.0, &mut rng));
        let place = |at: &[f64; 3]| turn * Vector3::from(*at);
        let cloud = PLACES.iter().map(|at| measured(place(at) + within(0.015, &mut rng), [0.01; 3])).collect();
        let frame = Frame { model: model(), cloud, candidates: Candidates::all(7, 7), prior: None };
        let found: Vec<Correspondence> = (0..7).map(|i| Correspondence { model: i, cloud: i }).collect();
        let expected = expected_sets_as_good(&frame.problem(0.05), &found);
        assert!(expected > 0.0 && expected < 1e-6, "{expected}");
    }
}

/// Four points of one row of a chessboard, found by a tight prior, have a number of false alarms although they determine
/// no rotation about their line.
#[test]
fn pairs_on_a_line_have_a_number() {
    let model: Vec<ModelPoint> = (0..54)
        .map(|i| ModelPoint::exact("", Point::new(0.025 * f64::from(i % 9), -0.025 * f64::from(i / 9), 0.0)))
        .collect();
    // Measured places (m), and the upper triangles of their covariances (m²).
    let rows = [
        ([0.18900, -0.09149, 0.96332], [1.949e-6, -1.0614e-6, 1.131e-5, 6.839e-7, -6.4431e-6, 6.839e-5]),
        ([0.16543, -0.09563, 0.95781], [1.383e-6, -9.138e-7, 9.2283e-6, 7.1304e-7, -6.4578e-6, 6.505e-5]),
        ([0.14105, -0.09907, 0.94806], [9.255e-7, -7.547e-7, 7.2734e-6, 7.3355e-7, -6.4165e-6, 6.173e-5]),
        ([0.11730, -0.10325, 0.94340], [5.764e-7, -5.951e-7, 5.4767e-6, 7.6676e-7, -6.4218e-6, 5.895e-5]),
    ];
    let cloud: Vec<MeasuredPoint> = rows
        .iter()
        .map(|(at, [xx, xy, xz, yy, yz, zz])| {
            let covariance = Matrix3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
            MeasuredPoint { position: UncertainPoint { at: Point::from(*at), covariance }, pixels: None }
        })
        .collect();
    let attitude = Matrix3::new(0.04393, 0.95287, 0.3002, 0.7658, 0.16085, -0.62264, -0.64158, 0.25724, -0.72263);
    let attitude = UnitQuaternion::from_matrix(&attitude);
    let camera_from_object = Transform::new(attitude, Vector3::new(0.20538, -0.23966, 1.09938));
    let bound = PriorBound::Gaussian(Covariance6::isotropic(0.2_f64.to_radians(), 0.0015));
    let prior = Prior { object_from_camera: camera_from_object.inverse(), bound };
    let row = |i: usize| if i % 9 == 8 && (1..5).contains(&(i / 9)) { vec![i / 9 - 1] } else { Vec::new() };
    let candidates = Candidates { lists: (0..54).map(row).collect() };
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Sigmas(3.0),
        prior: Some(&prior),
        edges: Default::default(),
    };
    let pairs: Vec<Correspondence> = (0..4).map(|k| Correspondence { model: 9 * (k + 1) + 8, cloud: k }).collect();
    let nfa = expected_sets_as_good(&problem, &pairs);
    assert!(nfa >= 0.0, "{nfa}");
}
