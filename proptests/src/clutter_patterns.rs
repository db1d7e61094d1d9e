//! Scenes with structured clutter, which is not uniform in any gate.

use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_referencing::{Gate, ModelPoint, Prior, PriorBound, Problem, Tolerance, candidates};

use crate::problems::Planted;

/// The kind of clutter of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClutterPattern {
    /// A grating of 5 × 4 object points, continued by clutter on the same grating.
    Grating,
    /// An object with twelve of the points of a grating of 6 × 5, continued by clutter on the same grating.
    Gaps,
    /// Object points and clutter on the edges of a box.
    Edges,
    /// Object points in pairs nearer than twice the tolerance, each point measured twice.
    Doubles,
    /// Object points anywhere, with clutter clumped about each, 4 cm on each coordinate, in gates of 10 cm.
    Clumped,
}

impl ClutterPattern {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Grating, Self::Gaps, Self::Edges, Self::Doubles, Self::Clumped];

    /// Half-size of the gate (m).
    fn gate(self) -> f64 {
        if self == Self::Clumped { 0.1 } else { GATE }
    }
}

/// A scene: the problem of a search.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Model, cloud, candidates and truth.
    pub planted: Planted,
    /// The prior pose.
    pub prior: Option<Prior>,
}

impl Scene {
    /// The problem for a search.
    pub fn problem(&self) -> Problem<'_> {
        Problem { prior: self.prior.as_ref(), ..self.planted.problem() }
    }
}

/// Half-size of the box whose edges carry points (m).
const HALF: [f64; 3] = [1.25, 0.75, 0.75];
/// Distance of neighbouring points of the grating (m).
const PITCH: f64 = 0.3;
/// Standard deviation of clutter clumped about a point (m).
const BUNCH: f64 = 0.04;
/// Standard deviation of a measured coordinate (m), tolerance of a distance, and half-size of a gate.
const SIGMA: f64 = 0.01;
const DELTA: f64 = 0.045;
const GATE: f64 = 0.5;

fn normal(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    // The sum of twelve uniform numbers approximates a Gaussian sufficiently.
    Vector3::from_fn(|_, _| (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>())
}

fn anywhere(rng: &mut ChaCha8Rng, half: &Vector3<f64>) -> Vector3<f64> {
    half.map(|side| rng.random_range(-side..side))
}

fn on_edge(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let along = rng.random_range(0..3);
    let at = anywhere(rng, &Vector3::from(HALF));
    Vector3::from_fn(|axis, _| if axis == along { at[axis] } else { HALF[axis] * at[axis].signum() })
}

/// Points with a minimum distance between any two.
fn apart(rng: &mut ChaCha8Rng, count: usize, min: f64, draw: fn(&mut ChaCha8Rng) -> Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut points: Vec<Vector3<f64>> = Vec::new();
    while points.len() < count {
        let at = draw(rng);
        if points.iter().all(|other| (at - other).norm() >= min) {
            points.push(at);
        }
    }
    points
}

/// A scene with `visible` object points in view and a prior.
pub fn scene(clutter_pattern: ClutterPattern, visible: usize, seed: u64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let rng = &mut rng;
    let nodes = |columns: std::ops::Range<i32>, rows: std::ops::Range<i32>| {
        let at = columns.flat_map(move |x| rows.clone().map(move |y| [x, y]));
        at.map(|[x, y]| Vector3::new(PITCH * f64::from(x), PITCH * f64::from(y), 0.0)).collect::<Vec<_>>()
    };
    let wide = Vector3::from(HALF) + Vector3::from_element(GATE);
    let (model, imitating) = match clutter_pattern {
        ClutterPattern::Grating | ClutterPattern::Gaps => {
            let full = clutter_pattern == ClutterPattern::Grating;
            let mut of_object = if full { nodes(0..5, 0..4) } else { nodes(0..6, 0..5) };
            while !full && of_object.len() > 12 {
                of_object.swap_remove(rng.random_range(0..of_object.len()));
            }
            let fraction = rng.random_range(0.3..0.8);
            let all = nodes(-3..9, -3..8).into_iter();
            let clutter =
                all.filter(|at| visible == 0 || !of_object.contains(at)).filter(|_| rng.random_bool(fraction));
            let clutter = clutter.collect::<Vec<_>>();
            (of_object, clutter)
        }
        ClutterPattern::Edges => {
            let count = rng.random_range(8..=14);
            let model = apart(rng, count, 0.2, on_edge);
            let clutter = (0..rng.random_range(40..=90)).map(|_| on_edge(rng)).collect();
            (model, clutter)
        }
        ClutterPattern::Doubles => {
            let draw = |rng: &mut ChaCha8Rng| anywhere(rng, &Vector3::new(0.8, 0.6, 0.4));
            let first = apart(rng, 5, 0.3, draw);
            let second: Vec<_> = first.iter().map(|at| at + normal(rng).normalize() * 0.7 * DELTA).collect();
            let clutter = (0..35).map(|_| anywhere(rng, &Vector3::new(1.2, 1.0, 0.8))).collect::<Vec<_>>();
            let twice = clutter.iter().flat_map(|at| [*at, *at]).collect();
            (first.into_iter().chain(second).collect(), twice)
        }
        ClutterPattern::Clumped => {
            let count = rng.random_range(15..=20);
            let model = apart(rng, count, 0.2, |rng| anywhere(rng, &Vector3::from(HALF)));
            let about = |rng: &mut ChaCha8Rng| model[rng.random_range(0..model.len())] + normal(rng) * BUNCH;
            let clutter = (0..rng.random_range(100..=200)).map(|_| about(rng)).collect();
            (model, clutter)
        }
    };
    let turn = Vector3::from_fn(|_, _| rng.random_range(-0.4..0.4));
    let camera_from_object = Transform::<Camera, Object>::new(so3::exp(&turn), Vector3::new(0.0, 0.0, 4.0));
    let mut order: Vec<usize> = (0..model.len()).collect();
    for k in (1..order.len()).rev() {
        order.swap(k, rng.random_range(0..=k));
    }
    let twice = if clutter_pattern == ClutterPattern::Doubles { 2 } else { 1 };
    let mut places: Vec<Vector3<f64>> = order.iter().take(visible).flat_map(|&i| vec![model[i]; twice]).collect();
    places.extend(imitating);
    places.extend((0..10).map(|_| anywhere(rng, &wide)));
    let cloud: Vec<MeasuredPoint> = places
        .iter()
        .map(|at| (camera_from_object * Point::from(*at)).coords + normal(rng) * SIGMA)
        .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(Point::from(at), SIGMA), pixels: None })
        .collect();
    let gate = clutter_pattern.gate();
    let turned = UnitQuaternion::from_scaled_axis(normal(rng) * 0.03 * (gate / GATE)) * camera_from_object.rotation();
    let moved = camera_from_object.translation() + anywhere(rng, &Vector3::from_element(0.5 * gate));
    let shifted = Transform::<Camera, Object>::new(turned, moved);
    let prior = Prior { object_from_camera: shifted.inverse(), bound: PriorBound::Box(gate) };
    let model: Vec<ModelPoint> =
        model.iter().enumerate().map(|(i, at)| ModelPoint::exact(format!("P{i}"), Point::from(*at))).collect();
    let candidates = candidates(&model, &cloud, Some(&prior), &Gate::Box(gate), None);
    let planted = Planted {
        model,
        cloud,
        candidates,
        tolerance: Tolerance::Fixed(DELTA),
        truth: Vec::new(),
        pose: camera_from_object.inverse(),
    };
    Scene { planted, prior: Some(prior) }
}
