//! A vehicle that goes from object to object: true poses, odometry and fixes with errors as stated.

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform, UncertainPoint, World, so3};
use seafix_navigation::{ConsiderStates, Navigated, ObjectPlacement, ObjectPose, RelativeMotion};
use seafix_referencing::{Mahalanobis, Observation, Observations, Solver};
use seafix_simulation::{Purpose, Stream};

/// What a voyage is made of.
#[derive(Debug, Clone)]
pub struct NavigationScenario {
    /// Objects along the way, each 10 m from the one before, up to 3 m aside.
    pub objects: usize,
    /// Standard deviations of a step of odometry: attitude (rad) and position (m), an axis.
    pub odometry: (f64, f64),
    /// The same of a fix.
    pub fix: (f64, f64),
    /// The same of an object's surveyed place.
    pub survey: (f64, f64),
    /// Which share of a fix's variance is common to all fixes of one object: its model's.
    pub shared: f64,
    /// The way of one step (m).
    pub step: f64,
    /// Standard deviation of the change of heading in a step (rad); 0 goes straight on.
    pub meander: f64,
    /// Standard deviation of the points of each object's model (m), where they are looked at.
    pub model: f64,
    /// The same of a point measured by the cameras, an axis.
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

/// A voyage on its way: one of many with the same settings.
#[derive(Debug)]
pub struct Sailing<'a> {
    settings: &'a NavigationScenario,
    stream: Stream,
    /// Where the objects truly stand.
    pub world_from_object: Vec<Transform<World, Object>>,
    /// Where the survey says they stand.
    pub surveyed: Vec<ObjectPlacement>,
    /// Where the camera truly is.
    pub world_from_camera: Transform<World, Camera>,
    heading: f64,
    /// Of each object, what all its fixes err by.
    common: Vec<Vector6<f64>>,
    /// Of each object the points: where they are, and where its model has them.
    points: Vec<Vec<[Point<Object>; 2]>>,
    /// Whether it goes backwards.
    back: bool,
}

/// Points of an object, within a metre of its origin.
const POINTS: usize = 10;
/// The tangent of the angle from the optical axis within which a point is in view.
const VIEW: f64 = 1.5;

impl NavigationScenario {
    /// The voyage number `number`.
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
    /// One step along a meandering way, and what odometry says of it.
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

    /// A fix at an object.
    pub fn fix(&mut self, object: usize) -> Navigated {
        let (attitude, position) = self.settings.fix;
        let own = normal6(&mut self.stream, self.settings.fix) * (1.0 - self.settings.shared).sqrt();
        let error = Transform::<Camera, Camera>::exp(&(own + self.common[object]));
        let object_from_camera = self.truth(object) * error.inverse();
        let covariance = Covariance6::isotropic(attitude, position);
        Navigated { object, object_pose: ObjectPose::new(object_from_camera, covariance) }
    }

    /// From now on it goes the other way.
    pub fn turn_about(&mut self) {
        self.back = !self.back;
    }

    /// A fix by the points of an object that are in view, as a solver makes it of its model and of what the cameras
    /// measure; `None` where too few are in view.
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
        let (data, solver) = (Observations { points, rig: None }, Mahalanobis::default());
        let pose = solver.solve(&data).ok()?;
        let errors = places.into_iter().zip(solver.model_errors(&data, &pose).ok()?);
        let object_pose = ObjectPose::new(pose, solver.covariance(&data, &pose).ok()?);
        Some(Navigated {
            object,
            object_pose: object_pose.with_consider_states(ConsiderStates::of_model(object, errors)),
        })
    }

    /// A fix that is wrong by a turn of up to half a turn and a shift of up to `reach` (m).
    pub fn wrong_fix(&mut self, object: usize, reach: f64) -> Navigated {
        let turn = self.stream.normal3(1.0).normalize() * self.stream.between(0.2, 3.1);
        let shift = self.stream.normal3(1.0).normalize() * self.stream.between(0.1 * reach, reach);
        let xi = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        let right = self.fix(object).object_pose;
        let object_from_camera = right.object_from_camera.perturbed(&xi);
        Navigated { object, object_pose: ObjectPose::new(object_from_camera, right.covariance) }
    }

    /// Moves an object by `metres` in a direction of its own, without telling the survey.
    pub fn displace(&mut self, object: usize, metres: f64) {
        let shift = self.stream.normal3(1.0).normalize() * metres;
        let moved = Transform::<Object, Object>::new(so3::exp(&self.stream.normal3(0.02)), shift);
        self.world_from_object[object] = self.world_from_object[object] * moved;
    }

    /// The camera relative to an object.
    pub fn truth(&self, object: usize) -> Transform<Object, Camera> {
        self.world_from_object[object].inverse() * self.world_from_camera
    }

    /// The normalised error squared of a pose.
    pub fn nees(&self, pose: &Navigated) -> f64 {
        let error = pose.object_pose.object_from_camera.error_to(&self.truth(pose.object));
        let matrix: Matrix6<f64> = pose.object_pose.covariance.matrix;
        matrix.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
    }

    /// The distance between the believed and the true place of the camera (m).
    pub fn off(&self, pose: &Navigated) -> f64 {
        (pose.object_pose.object_from_camera.translation() - self.truth(pose.object).translation()).norm()
    }
}
