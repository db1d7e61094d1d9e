//! The controlled vehicle: a PID controller follows the route.

use nalgebra::{DVector, UnitQuaternion, Vector3, Vector6};
use seafix_component::{Settings, in_range};
use seafix_geometry::{Body, Transform, so3};
use serde::{Deserialize, Serialize};

use super::{
    current::{Current, Fluctuation},
    model::{Model, Motion},
    route::{Goal, PlannedRoute},
    track::{RATE, Track, VehicleState},
};
use crate::seabed::Seabed;

/// The vehicle models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum VehicleKind {
    /// An ideal carriage: the cameras follow the route exactly.
    Rail,
    /// A hovering vehicle of 200 kg with five thrusters.
    #[default]
    Hover200,
    /// BlueROV2 Heavy.
    Bluerov2Heavy,
}

/// The vehicle and its PID controller. Gains apply to position and velocity errors and are scaled by the vehicle's
/// mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Vehicle {
    /// The vehicle model.
    pub kind: VehicleKind,
    /// Proportional gain: force per metre of error and kilogram (1/s²), from 0 to 10.
    pub proportional: f64,
    /// Derivative gain: force per metre per second of error and kilogram (1/s), from 0 to 10.
    pub derivative: f64,
    /// Integral gain: force per metre·second of error and kilogram (1/s³), from 0 to 10.
    pub integral: f64,
}

impl Default for Vehicle {
    fn default() -> Self {
        Self { kind: VehicleKind::Hover200, proportional: 0.6, derivative: 1.4, integral: 0.06 }
    }
}

impl Vehicle {
    pub(crate) fn check(&self) -> Result<(), String> {
        for (name, x) in
            [("proportional", self.proportional), ("derivative", self.derivative), ("integral", self.integral)]
        {
            in_range((0.0..=10.0).contains(&x), &format!("vehicle.{name}"), x, "a number from 0 to 10")?;
        }
        Ok(())
    }

    /// Simulates the vehicle: its track, and the displacement of floating particles at the states' times.
    pub(crate) fn travel(
        &self,
        route: &PlannedRoute,
        duration: f64,
        body_from_camera: &Vector3<f64>,
        seabed: &Seabed,
        current: &Current,
        seeds: (u64, u64),
    ) -> (Track, Vec<Vector3<f64>>) {
        let count = (duration * RATE).ceil() as usize + 2;
        let goals: Vec<Goal> = (0..count).map(|k| route.at(k as f64 / RATE)).collect();
        let mut fluctuation = Fluctuation::new(current, seeds.0, seeds.1);
        let dt = 1.0 / RATE;
        let model = match self.kind {
            VehicleKind::Rail => None,
            VehicleKind::Hover200 => Some(Model::hover_200()),
            VehicleKind::Bluerov2Heavy => Some(Model::bluerov2_heavy()),
        };
        let mut pilot = model.map(|model| Pilot::new(self, model, &goals[0], body_from_camera));
        let mut drift = Vector3::zeros();
        let (mut states, mut drifts) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for k in 0..count {
            let goal = &goals[k];
            let height = seabed.depth() - goal.at.z;
            let flow = current.velocity(height, &fluctuation.now);
            drifts.push(drift);
            match &mut pilot {
                None => states.push(on_rails(&goals, k, body_from_camera)),
                Some(pilot) => {
                    states.push(pilot.state(&flow));
                    let before = &goals[k.saturating_sub(1)];
                    pilot.step(before, goal, &flow, dt);
                }
            }
            drift += flow * dt;
            fluctuation.step(dt);
        }
        (Track { states }, drifts)
    }
}

fn upright(heading: f64) -> UnitQuaternion<f64> {
    so3::exp(&(Vector3::z() * heading))
}

/// The state of an ideal vehicle exactly on the route, level.
fn on_rails(goals: &[Goal], k: usize, camera: &Vector3<f64>) -> VehicleState {
    let goal = &goals[k];
    let turn = upright(goal.heading);
    let (first, last) = (k.saturating_sub(1), (k + 1).min(goals.len() - 1));
    let span = (last - first) as f64 / RATE;
    let rate = libm::remainder(goals[last].heading - goals[first].heading, std::f64::consts::TAU) / span;
    let v = turn.inverse() * goal.velocity;
    let world_from_body = Transform::new(turn, goal.at - turn * camera);
    VehicleState { world_from_body, motion: Vector6::new(0.0, 0.0, rate, v.x, v.y, v.z) }
}

/// The vehicle and the state of its controller.
struct Pilot {
    model: Model,
    allocation: nalgebra::DMatrix<f64>,
    gains: [f64; 3],
    motion: Motion,
    /// Integrals of the position error (world) and of the heading error.
    sum: Vector3<f64>,
    turned: f64,
    camera: Vector3<f64>,
}

impl Pilot {
    fn new(settings: &Vehicle, model: Model, goal: &Goal, camera: &Vector3<f64>) -> Self {
        let turn = upright(goal.heading);
        let v = turn.inverse() * goal.velocity;
        let motion = Motion {
            at: goal.at - turn * camera,
            turn,
            nu: Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0),
            thrusts: vec![0.0; model.thrusters.len()],
        };
        let gains = [settings.proportional, settings.derivative, settings.integral];
        Self {
            allocation: model.allocation(),
            model,
            gains,
            motion,
            sum: Vector3::zeros(),
            turned: 0.0,
            camera: *camera,
        }
    }

    /// The state over ground; (ω, v) in this crate's order.
    fn state(&self, flow: &Vector3<f64>) -> VehicleState {
        let Motion { at, turn, nu, .. } = &self.motion;
        let v = nu.fixed_rows::<3>(0).into_owned() + turn.inverse() * flow;
        let motion = Vector6::new(nu[3], nu[4], nu[5], v.x, v.y, v.z);
        VehicleState { world_from_body: Transform::<_, Body>::new(*turn, *at), motion }
    }

    fn step(&mut self, before: &Goal, goal: &Goal, flow: &Vector3<f64>, dt: f64) {
        let [p, d, i] = self.gains;
        let now = self.state(flow);
        let turn = self.motion.turn;
        let heading = libm::atan2((turn * Vector3::x()).y, (turn * Vector3::x()).x);
        let error = goal.at - upright(goal.heading) * self.camera - self.motion.at;
        let slip = goal.velocity - turn * now.motion.fixed_rows::<3>(3).into_owned();
        // The integrator is frozen while the error is large (anti-windup).
        if error.norm() < 1.0 {
            self.sum += error * dt;
        }
        let max_deviation = libm::remainder(goal.heading - heading, std::f64::consts::TAU);
        let rate = libm::remainder(goal.heading - before.heading, std::f64::consts::TAU) / dt;
        self.turned += if max_deviation.abs() < 0.5 { max_deviation * dt } else { 0.0 };
        let m = self.model.inertia_matrix().diagonal();
        let along = turn.inverse() * (error * p + slip * d + self.sum * i);
        // Feed-forward of the drag at the desired velocity.
        let through = turn.inverse() * (goal.velocity - flow);
        let ahead = |k: usize| (self.model.linear[k] + self.model.quadratic[k] * through[k].abs()) * through[k];
        let force = |k: usize| m[k] * along[k] + ahead(k);
        let yaw = m[5] * (2.0 * p * max_deviation + 1.6 * d * (rate - now.motion[2]) + i * self.turned);
        // Pitch is controlled to zero; roll is passively stable.
        let pitch = libm::asin((-(turn * Vector3::x()).z).clamp(-1.0, 1.0));
        let level = m[4] * (-2.0 * p * pitch - 1.6 * d * now.motion[1]);
        let wanted = DVector::from_column_slice(&[force(0), force(1), force(2), 0.0, level, yaw]);
        let commands = self.model.saturated(&(&self.allocation * wanted));
        self.motion = self.model.step(&self.motion, &commands, flow, dt);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn travel(kind: VehicleKind, current: &Current, speed: f64) -> (Track, PlannedRoute) {
        let places = vec![Vector3::new(0.0, 0.0, 36.0), Vector3::new(8.0, 0.0, 36.0), Vector3::new(8.0, 6.0, 36.0)];
        let route = PlannedRoute::through(places, None, speed);
        let seabed = Seabed::with_relief(40.0, 0.0, 1);
        let vehicle = Vehicle { kind, ..Vehicle::default() };
        let duration = route.length() / speed + 5.0;
        (vehicle.travel(&route, duration, &Vector3::zeros(), &seabed, current, (1, 0)).0, route)
    }

    fn max_deviation(track: &Track, route: &PlannedRoute) -> f64 {
        let after = (3.0 * RATE) as usize;
        let error =
            |(k, s): (usize, &VehicleState)| (s.world_from_body.translation() - route.at(k as f64 / RATE).at).norm();
        track.states.iter().enumerate().skip(after).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn vehicles_keep_to_their_path_also_in_a_current() {
        let calm = Current::default();
        let flow = Current { speed: 0.2, sigma: 0.03, ..Current::default() };
        for (kind, speed) in [(VehicleKind::Hover200, 0.5), (VehicleKind::Bluerov2Heavy, 0.3)] {
            for current in [&calm, &flow] {
                let (track, route) = travel(kind, current, speed);
                let max = max_deviation(&track, &route);
                assert!(max < 0.35, "{kind:?} {current:?}: {max}");
            }
        }
        let (track, route) = travel(VehicleKind::Rail, &flow, 0.5);
        assert!(max_deviation(&track, &route) < 1e-12);
    }

    #[test]
    fn motion_is_the_derivative_of_the_pose() {
        let (track, _) = travel(VehicleKind::Hover200, &Current { speed: 0.1, ..Current::default() }, 0.5);
        for k in (200..2000).step_by(150) {
            let (a, b) = (&track.states[k], &track.states[k + 1]);
            let step = a.world_from_body.inverse() * b.world_from_body;
            let mean = (a.motion + b.motion) * 0.5;
            assert!((step.log() * RATE - mean).norm() < 2e-3, "{k}");
        }
    }
}
