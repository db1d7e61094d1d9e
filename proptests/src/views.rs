//! An object before the camera, with some points in view among clutter: scenes for laws of the default search.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_referencing::{
    Acceptance, Attempt, Candidates, Gate, Mahalanobis, ModelPoint, Outcome, Prior, PriorBound, Problem,
    RigidConsensus, Tolerance, candidates, compute_fix,
};
use seafix_simulation::{Purpose, Stream};

/// Uniform positions in a box of these half-sizes about the origin.
pub fn anywhere(stream: &mut Stream, half: [f64; 3]) -> Vector3<f64> {
    Vector3::from(half.map(|half| stream.between(-half, half)))
}

/// A rotation by up to 3.1 rad about any axis.
pub fn any_turn(stream: &mut Stream) -> UnitQuaternion<f64> {
    so3::exp(&(stream.normal3(1.0).normalize() * stream.between(0.0, 3.1)))
}

/// A model of exact points without normals.
pub fn exact_model(points: &[Vector3<f64>]) -> Vec<ModelPoint> {
    let point = |(k, at): (usize, &Vector3<f64>)| ModelPoint::exact(format!("p{k}"), Point::from(*at));
    points.iter().enumerate().map(point).collect()
}

/// The measurements of an object, and its pose.
#[derive(Debug, Clone)]
pub struct View {
    /// The object.
    pub model: Vec<ModelPoint>,
    /// The measured points of it, then clutter.
    pub cloud: Vec<MeasuredPoint>,
    /// The true pose.
    pub truth: Transform<Object, Camera>,
    /// The prior pose, if any.
    pub prior: Option<Prior>,
    sigma: f64,
}

impl View {
    /// The measurements of these model points, with noise `sigma` (m) on each coordinate, without clutter and prior
    /// pose.
    pub fn of(
        stream: &mut Stream,
        model: Vec<ModelPoint>,
        camera_from_object: Transform<Camera, Object>,
        seen: impl IntoIterator<Item = usize>,
        sigma: f64,
    ) -> Self {
        let truth = camera_from_object.inverse();
        let mut view = Self { model, cloud: Vec::new(), truth, prior: None, sigma };
        for i in seen {
            let at = camera_from_object * view.model[i].at + stream.normal3(sigma);
            view.measure(at);
        }
        view
    }

    /// Adds clutter points, uniform in a box of these half-sizes (m), `distance` (m) ahead.
    #[must_use]
    pub fn among(mut self, stream: &mut Stream, count: usize, distance: f64, half: [f64; 3]) -> Self {
        for _ in 0..count {
            self.measure(Point::from(Vector3::z() * distance + anywhere(stream, half)));
        }
        self
    }

    /// A prior pose that predicts every model point within `half` (m) of its true position on each camera axis. It is
    /// the true pose, rotated and then shifted by a draw of `error` (rad about the camera's axes, m); the first draw
    /// that is near enough is used.
    #[must_use]
    pub fn before(mut self, half: f64, mut error: impl FnMut() -> [Vector3<f64>; 2]) -> Self {
        let camera_from_object = self.truth.inverse();
        self.prior = Some(loop {
            let [turn, step] = error();
            let turned = so3::exp(&turn) * camera_from_object.rotation();
            let moved = Transform::<Camera, Object>::new(turned, camera_from_object.translation() + step);
            let off = |point: &ModelPoint| (moved * point.at - camera_from_object * point.at).amax();
            if self.model.iter().all(|point| off(point) <= half) {
                break Prior { object_from_camera: moved.inverse(), bound: PriorBound::Box(half) };
            }
        });
        self
    }

    fn measure(&mut self, at: Point<Camera>) {
        self.cloud.push(MeasuredPoint { position: UncertainPoint::isotropic(at, self.sigma), pixels: None });
    }

    /// The answer of the default search and `mahalanobis`, with candidates by the prior pose, or all without one.
    pub fn outcome(&self, delta: f64, acceptance: &Acceptance) -> Outcome {
        self.attempt(delta, acceptance).outcome
    }

    /// The attempt with the same method and candidates.
    pub fn attempt(&self, delta: f64, acceptance: &Acceptance) -> Attempt {
        let Self { model, cloud, prior, .. } = self;
        let candidates = match prior {
            Some(prior) => candidates(model, cloud, Some(prior), &Gate::default(), None),
            None => Candidates::all(model.len(), cloud.len()),
        };
        self.attempt_of(&candidates, delta, acceptance)
    }

    /// The outcome for these candidates.
    pub fn outcome_of(&self, candidates: &Candidates, delta: f64, acceptance: &Acceptance) -> Outcome {
        self.attempt_of(candidates, delta, acceptance).outcome
    }

    fn attempt_of(&self, candidates: &Candidates, delta: f64, acceptance: &Acceptance) -> Attempt {
        let Self { model, cloud, prior, .. } = self;
        let problem = Problem {
            model,
            cloud,
            candidates,
            tolerance: Tolerance::Fixed(delta),
            prior: prior.as_ref(),
            edges: Default::default(),
        };
        let mut stream = Stream::new(0, 0, 0, Purpose::Search);
        let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
        compute_fix(&problem, &search, &solver, acceptance, None, stream.rng())
    }
}
