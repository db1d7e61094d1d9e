use nalgebra::UnitQuaternion;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Covariance6, MeasuredPoint, Point, Transform, UncertainPoint};

use super::*;
use crate::{
    candidates::{Candidates, Gate},
    problem::{Prior, PriorBound, Tolerance},
    search::{
        consensus::{graph::ConsistencyGraph, likelihood::PairTerms},
        identification::Search,
        posterior::PosteriorProbabilities,
        rigid_consensus::RigidConsensus,
    },
    site::model::ModelPoint,
};

const STEP: f64 = 0.1;
const COLUMNS: i8 = 5;

fn lattice(columns: std::ops::Range<i8>) -> impl Iterator<Item = Vector3<f64>> {
    columns.flat_map(|x| (0..4).map(move |y| STEP * Vector3::new(f64::from(x), f64::from(y), 0.0)))
}

fn prior(sigma: f64) -> Prior {
    let bound = PriorBound::Gaussian(Covariance6::isotropic(0.002, sigma));
    let at = Vector3::new(0.0, 0.0, -2.0);
    Prior { object_from_camera: Transform::new(UnitQuaternion::identity(), at), bound }
}

/// The probabilities for a lattice of five columns 2 m ahead of which the cloud shows these columns; the prior has this
/// standard deviation of the position (m). Also the shifts (columns) of the explanations.
fn shown(columns: std::ops::Range<i8>, sigma: f64) -> (PosteriorProbabilities, Vec<i32>) {
    seen(lattice(columns).collect(), sigma)
}

/// The same for any places of the lattice.
fn seen(places: Vec<Vector3<f64>>, sigma: f64) -> (PosteriorProbabilities, Vec<i32>) {
    let model: Vec<ModelPoint> = lattice(0..COLUMNS).map(|at| ModelPoint::exact("", Point::from(at))).collect();
    let measured = |at: Vector3<f64>| UncertainPoint::isotropic((at + Vector3::new(0.0, 0.0, 2.0)).into(), 0.003);
    let cloud: Vec<MeasuredPoint> =
        places.into_iter().map(|at| MeasuredPoint { position: measured(at), pixels: None }).collect();
    let (tolerance, prior) = (Tolerance::Sigmas(3.0), prior(sigma));
    let candidates = crate::candidates::candidates(&model, &cloud, Some(&prior), &Gate::default(), None);
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance,
        prior: Some(&prior),
        edges: Default::default(),
    };
    let found = RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0)).expect("a pose");
    let posterior = found.posterior.expect("a posterior");
    let by = |pose: &Transform<_, _>| (pose.inverse().translation().x / STEP).round() as i32;
    let mut shifts: Vec<i32> = posterior.explanations.iter().map(|other| by(&other.object_from_camera)).collect();
    shifts.sort_unstable();
    shifts.dedup();
    (posterior.probabilities(&model, 0.03), shifts)
}

/// A lattice that continues by two columns to each side: a prior of a tenth of a step decides where the object is; a
/// prior of three steps leaves it open. Listed are all shifts at which more than half of the object shows: five of them
/// show all of it, a shift by four shows three of its five columns.
#[test]
fn the_prior_decides_between_the_shifts() {
    let (sure, _) = shown(-2..COLUMNS + 2, 0.1 * STEP);
    assert!(sure.map_estimate > 0.999, "{sure:?}");
    let (open, shifts) = shown(-2..COLUMNS + 2, 3.0 * STEP);
    assert!(open.map_estimate < 0.5, "{open:?}");
    assert_eq!(shifts, [-4, -3, -2, -1, 0, 1, 2, 3, 4]);
}

/// A lattice that ends where the object ends is the object, even for a prior of three steps.
#[test]
fn a_complete_identification_decides() {
    let (complete, _) = shown(0..COLUMNS, 3.0 * STEP);
    assert!(complete.map_estimate > 0.999, "{complete:?}");
}

/// Two points that lie on the lattice beyond a complete identification are not its continuation; with a corner unseen
/// they may be, since detectors lose a pattern in blocks.
#[test]
fn few_points_beyond_a_complete_identification_do_not_continue_it() {
    let with_corners = |unseen: usize| {
        let corners = [[-1.0, -1.0, 0.0], [5.0, 4.0, 0.0]].map(|at| STEP * Vector3::from(at));
        seen(lattice(0..COLUMNS).skip(unseen).chain(corners).collect(), 3.0 * STEP).0
    };
    let (complete, incomplete) = (with_corners(0), with_corners(1));
    assert!(complete.map_estimate > 0.999, "{complete:?}");
    assert!(incomplete.map_estimate < 0.9, "{incomplete:?}");
}

/// One more column beyond a complete identification: the object may be one step away, but it is not absent. Seen to fail,
/// with a probability of absence of 0.61, if the shifted poses count as structured clutter.
#[test]
fn a_shift_of_the_pattern_is_no_structured_clutter() {
    let (open, shifts) = shown(0..COLUMNS + 1, STEP);
    assert!(open.absent < 1e-6 && open.elsewhere > 0.5, "{open:?}");
    assert_eq!(shifts, [0, 1, 2, 3]);
}

/// The sides (right, left, up, down) to which a grid goes on, seen from the pose of a mode `from` steps away in x.
///
/// The model has 9 × 6 points of a standard deviation `sigma` (m), the cloud one column more, each point at `place`.
fn sides_of_a_grid(from: f64, sigma: f64, place: impl Fn(usize, Vector3<f64>) -> Vector3<f64>) -> [bool; 4] {
    let grid = |columns: std::ops::Range<i8>| {
        columns.flat_map(|x| (0..6).map(move |y| STEP * Vector3::new(f64::from(x), f64::from(y), 0.0)))
    };
    let known = |at| ModelPoint { sigma, ..ModelPoint::exact("", Point::from(at)) };
    let model: Vec<ModelPoint> = grid(0..9).map(known).collect();
    let ahead = Vector3::new(0.0, 0.0, 2.0);
    let measured = |at: Vector3<f64>| UncertainPoint::isotropic((at + ahead).into(), 0.003 - sigma);
    let places = grid(0..10).enumerate().map(|(i, at)| place(i, at));
    let cloud: Vec<MeasuredPoint> = places.map(|at| MeasuredPoint { position: measured(at), pixels: None }).collect();
    let prior = prior(STEP);
    let candidates = crate::candidates::candidates(&model, &cloud, Some(&prior), &Gate::default(), None);
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Sigmas(3.0),
        prior: Some(&prior),
        edges: Default::default(),
    };
    let prior_terms = PriorTerms::of(&problem).expect("a prior");
    let graph = ConsistencyGraph::of(&problem, &prior_terms);
    let terms = PairTerms::of(&problem, &prior_terms, &graph);
    let (parts, none) = ((&terms, &prior_terms, &graph), BTreeSet::new());
    let pattern = Pattern::of(&model, &[]).expect("a lattice");
    let start = Motion { rotation: Matrix3::identity(), translation: ahead + from * STEP * Vector3::x() };
    let mode = Climb::new(&model, parts, &none).near(&start).expect("a pose");
    assert_eq!(mode.members.len(), 54);
    [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
        .map(|[x, y]| pattern.goes_on_to(&problem, parts, &mode, &(STEP * Vector3::new(x, y, 0.0))))
}

/// A pattern with one more column on one side goes on to this side alone; from the pose shifted there, it goes on to the
/// other side alone. Seen to fail if the places on all sides decide together: 24 of these 30 places are not seen.
#[test]
fn a_pattern_goes_on_at_the_sides_where_it_is_seen() {
    assert_eq!(sides_of_a_grid(0.0, 0.0, |_, at| at), [true, false, false, false]);
    assert_eq!(sides_of_a_grid(1.0, 0.0, |_, at| at), [false, true, false, false]);
}

/// Places beyond the object are as uncertain as the model's points. Seen to fail with the noise of the cloud alone.
#[test]
fn a_pattern_goes_on_where_places_are_uncertain() {
    let moved = |i: usize, at: Vector3<f64>| at + [1.0, -1.0][i % 2] * Vector3::new(0.0, 0.0, 0.003);
    assert_eq!(sides_of_a_grid(0.0, 0.0028, moved), [true, false, false, false]);
}

/// A row of step s: ln N(x; 0, σ²) of its own direction against 1/s.
#[test]
fn the_phase_of_a_pattern_is_uniform_over_a_cell() {
    let model: Vec<ModelPoint> = lattice(0..COLUMNS).map(|at| ModelPoint::exact("", Point::from(at))).collect();
    let candidates = Candidates::all(model.len(), 0);
    let (tolerance, prior) = (Tolerance::Sigmas(3.0), prior(0.03));
    let problem = Problem {
        model: &model,
        cloud: &[],
        candidates: &candidates,
        tolerance,
        prior: Some(&prior),
        edges: Default::default(),
    };
    let prior_terms = PriorTerms::of(&problem).expect("a prior");
    let known = &prior_terms.known.as_ref().expect("a prior").motion;
    let moved = Motion { translation: known.translation + Vector3::new(0.05, 0.0, 0.7), ..*known };
    let found = ln_phase(&[Vector3::new(STEP, 0.0, 0.0)], &prior_terms, &moved);
    // The attitude moves the centroid, 2 m ahead, by 0.002 · 2 m.
    let variance = 0.03f64.powi(2) + 0.004f64.powi(2);
    let ln_density = -HALF_LN_2PI - 0.5 * variance.ln() - 0.5 * 0.05f64.powi(2) / variance;
    assert!((found + STEP.ln() + ln_density).abs() < 0.01, "{found}");
}
