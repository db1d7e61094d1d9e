//! A vehicle that travels from object to object: true poses, odometry and fixes with the stated errors.

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform, UncertainPoint, World, so3};
use seafix_navigation::{ConsiderStates, Navigated, ObjectPlacement, ObjectPose, RelativeMotion};
use seafix_referencing::{Mahalanobis, Observation, Observations, Solver};
use seafix_simulation::{Purpose, Stream};

/// The settings of a dive.
#[derive(Debug, Clone)]
pub struct NavigationScenario {
    /// Number of objects on the route, every 10 m, up to 3 m aside.
    pub objects: usize,
    /// Standard deviations of an odometry step on each axis: attitude (rad) and position (m).
    pub odometry: (f64, f64),
    /// Standard deviations of a fix on each axis: attitude (rad) and position (m).
    pub fix: (f64, f64),
    /// Standard deviations of an object's surveyed pose on each axis: attitude (rad) and position (m).
    pub survey: (f64, f64),
    /// Fraction of a fix's variance that all fixes of an object share: the model's.
    pub shared: f64,
    /// Length of a step (m).
    pub step: f64,
    /// Standard deviation of the change of heading in a step (rad); 0 goes straight.
    pub meander: f64,
    /// Standard deviation of the points of each object's model (m), for fixes by points.
    pub model: f64,
    /// Standard deviation of a point measured by the cameras, on each axis (m).
    pub measured: f64,
}

impl Default for NavigationScenario {
    fn default() -> Self {
        Self {
            objects: 5,
            odometry: (1e-4, 1e-3),
            fix: (1e-3, 5e-3),
            survey: (2e-3, 5e-3),
            shared: 0.0,
            step: 0.3,
            meander: 0.02,
            model: 5e-3,
            measured: 5e-3,
        }
    }
}

/// A dive in progress: one of many with the same settings.
#[derive(Debug)]
pub struct Sailing<'a> {
    settings: &'a NavigationScenario,
    stream: Stream,
    /// The true poses of the objects.
    pub world_from_object: Vec<Transform<World, Object>>,
    /// The surveyed poses of the objects.
    pub surveyed: Vec<ObjectPlacement>,
    /// The true pose of the camera.
    pub world_from_camera: Transform<World, Camera>,
    heading: f64,
    /// For each object, the common error of all its fixes.
    common: Vec<Vector6<f64>>,
    /// For each object, its points: true positions and positions in the model.
    points: Vec<Vec<[Point<Object>; 2]>>,
    /// Whether the vehicle travels backwards.
    back: bool,
}

/// The points of an object, within a metre of its origin.
const POINTS: usize = 10;
/// Tangent of the half-angle of view: points within it are in view.
const VIEW: f64 = 1.5;

impl NavigationScenario {
    /// The dive with index `number`.
    pub fn set_out(&self, number: u64) -> Sailing<'_> {
        let mut stream = Stream::new(1, number, 0, Purpose::Points);
        let mut apart = Stream::new(1, number, 1, Purpose::Points);
        let common = (0..self.objects).map(|_| normal6(&mut apart, self.fix) * self.shared.sqrt()).collect();
        let mut built = Stream::new(1, number, 2, Purpose::Points);
        let mut point = || {
            let at = Vector3::from_fn(|_, _| built.between(-1.0, 1.0));
            [at, at + built.normal3(self.model)].map(Point::from)
        };
        let points = (0..self.objects).map(|_| (0..POINTS).map(|_| point()).collect()).collect();
        let down = so3::exp(&Vector3::new(0.0, 0.0, 0.3));
        let (mut world_from_object, mut surveyed) = (Vec::new(), Vec::new());
        for i in 0..self.objects {
            let turn = so3::exp(&(Vector3::new(0.0, 0.0, stream.between(-3.0, 3.0))));
            let at = down * Vector3::new(10.0 * i as f64, stream.between(-3.0, 3.0), 40.0);
            let truth = Transform::<World, Object>::new(turn, at);
            let covariance = Covariance6::isotropic(self.survey.0, self.survey.1);
            // T_true = T_survey Exp(ω).
            let error = Transform::<Object, Object>::exp(&normal6(&mut stream, self.survey));
            surveyed.push(ObjectPlacement { world_from_object: truth * error.inverse(), covariance });
            world_from_object.push(truth);
        }
        let world_from_camera = Transform::new(down, Vector3::new(0.0, 0.0, 37.0));
        Sailing {
            settings: self,
            stream,
            world_from_object,
            surveyed,
            world_from_camera,
            heading: 0.0,
            common,
            points,
            back: false,
        }
    }
}

fn normal6(stream: &mut Stream, (attitude, position): (f64, f64)) -> Vector6<f64> {
    let (phi, rho) = (stream.normal3(attitude), stream.normal3(position));
    Vector6::new(phi.x, phi.y, phi.z, rho.x, rho.y, rho.z)
}

impl Sailing<'_> {
    /// A step along the meandering route, as odometry measures it.
    pub fn step(&mut self) -> RelativeMotion {
        self.heading = 0.9 * self.heading + self.settings.meander * self.stream.normal();
        let ahead = if self.back { -self.settings.step } else { self.settings.step };
        let xi = Vector6::new(0.0, 0.0, self.heading, ahead, 0.0, 0.0);
        let motion = Transform::<Camera, Camera>::exp(&xi);
        self.world_from_camera = (self.world_from_camera * motion).renormalized();
        let error = Transform::<Camera, Camera>::exp(&normal6(&mut self.stream, self.settings.odometry));
        let (attitude, position) = self.settings.odometry;
        RelativeMotion::new(motion * error.inverse(), Covariance6::isotropic(attitude, position))
    }

    /// A fix of an object.
    pub fn fix(&mut self, object: usize) -> Navigated {
        let (attitude, position) = self.settings.fix;
        let own = normal6(&mut self.stream, self.settings.fix) * (1.0 - self.settings.shared).sqrt();
        let error = Transform::<Camera, Camera>::exp(&(own + self.common[object]));
        let object_from_camera = self.truth(object) * error.inverse();
        let covariance = Covariance6::isotropic(attitude, position);
        Navigated { object, object_pose: ObjectPose::new(object_from_camera, covariance) }
    }

    /// Reverses the direction of travel.
    pub fn turn_about(&mut self) {
        self.back = !self.back;
    }

    /// A fix from the points of an object in view, solved from its model and the cameras' measurements; `None` with too
    /// few points.
    pub fn observe(&mut self, object: usize) -> Option<Navigated> {
        let camera_from_object = self.truth(object).inverse();
        let (mut points, mut places) = (Vec::new(), Vec::new());
        for (index, [true_place, model]) in self.points[object].iter().enumerate() {
            let at = camera_from_object * *true_place;
            let noise = self.stream.normal3(self.settings.measured);
            if at.coords.z > 0.0 && at.coords.xy().amax() < VIEW * at.coords.z {
                let measured = UncertainPoint::isotropic(at + noise, self.settings.measured);
                points.push(Observation { measured, pixels: None, model: *model, model_sigma: self.settings.model });
                places.push(index);
            }
        }
        if points.len() < 4 {
            return None;
        }
        let (data, solver) = (Observations { points, edges: Vec::new(), rig: None }, Mahalanobis::default());
        let pose = solver.solve(&data).ok()?;
        let errors = places.into_iter().zip(solver.model_errors(&data, &pose).ok()?);
        let object_pose = ObjectPose::new(pose, solver.covariance(&data, &pose).ok()?);
        Some(Navigated {
            object,
            object_pose: object_pose.with_consider_states(ConsiderStates::of_model(object, errors)),
        })
    }

    /// A wrong fix: rotated by up to half a turn and shifted by up to `reach` (m).
    pub fn wrong_fix(&mut self, object: usize, reach: f64) -> Navigated {
        let turn = self.stream.normal3(1.0).normalize() * self.stream.between(0.2, 3.1);
        let shift = self.stream.normal3(1.0).normalize() * self.stream.between(0.1 * reach, reach);
        let xi = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        let right = self.fix(object).object_pose;
        let object_from_camera = right.object_from_camera.perturbed(&xi);
        Navigated { object, object_pose: ObjectPose::new(object_from_camera, right.covariance) }
    }

    /// Displaces an object by `metres` in its own direction, without a change of the survey.
    pub fn displace(&mut self, object: usize, metres: f64) {
        let shift = self.stream.normal3(1.0).normalize() * metres;
        let moved = Transform::<Object, Object>::new(so3::exp(&self.stream.normal3(0.02)), shift);
        self.world_from_object[object] = self.world_from_object[object] * moved;
    }

    /// The pose of the camera relative to an object.
    pub fn truth(&self, object: usize) -> Transform<Object, Camera> {
        self.world_from_object[object].inverse() * self.world_from_camera
    }

    /// The normalised estimation error squared of a pose.
    pub fn nees(&self, pose: &Navigated) -> f64 {
        let error = pose.object_pose.object_from_camera.error_to(&self.truth(pose.object));
        let matrix: Matrix6<f64> = pose.object_pose.covariance.matrix;
        matrix.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
    }

    /// The distance between estimated and true position of the camera (m).
    pub fn off(&self, pose: &Navigated) -> f64 {
        (pose.object_pose.object_from_camera.translation() - self.truth(pose.object).translation()).norm()
    }
}
