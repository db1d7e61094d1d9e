//! The vehicle's state at any time of the dive.

use nalgebra::{Vector3, Vector6};
use seafix_geometry::{Body, Transform, World, so3};

/// State rate (Hz).
pub(super) const RATE: f64 = 100.0;

/// The vehicle's state at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VehicleState {
    pub(crate) world_from_body: Transform<World, Body>,
    /// Angular velocity (rad/s) and velocity over ground (m/s) in the body frame.
    pub(crate) motion: Vector6<f64>,
}

/// States at equal time steps.
#[derive(Debug, Clone, Default)]
pub(crate) struct Track {
    pub(crate) states: Vec<VehicleState>,
}

impl Track {
    /// State rate (Hz).
    pub(crate) const RATE: f64 = RATE;

    /// The state at a time (s): cubic Hermite interpolation of the position, slerp of the attitude.
    pub(crate) fn at(&self, time: f64) -> VehicleState {
        let x = (time * RATE).clamp(0.0, (self.states.len() - 1) as f64);
        let k = (x as usize).min(self.states.len().saturating_sub(2));
        let (a, b) = (&self.states[k], &self.states[(k + 1).min(self.states.len() - 1)]);
        let t = x - k as f64;
        let (p, q) = (a.world_from_body, b.world_from_body);
        let velocity =
            |s: &VehicleState| s.world_from_body.rotation() * s.motion.fixed_rows::<3>(3).into_owned() / RATE;
        let (u, v): (Vector3<f64>, Vector3<f64>) = (velocity(a), velocity(b));
        let (t2, t3) = (t * t, t * t * t);
        let at = p.translation() * (2.0 * t3 - 3.0 * t2 + 1.0)
            + u * (t3 - 2.0 * t2 + t)
            + q.translation() * (3.0 * t2 - 2.0 * t3)
            + v * (t3 - t2);
        let turn = so3::log(&(p.rotation().inverse() * q.rotation()));
        let rotation = p.rotation() * so3::exp(&(turn * t));
        VehicleState { world_from_body: Transform::new(rotation, at), motion: a.motion + (b.motion - a.motion) * t }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vehicle_moves_smoothly_between_states() {
        // Interpolated positions of a circular motion stay on the circle.
        let state = |k: usize| {
            let angle = 0.02 * k as f64;
            let turn = so3::exp(&(Vector3::z() * angle));
            VehicleState {
                world_from_body: Transform::new(turn, turn * -Vector3::y() * 3.0),
                motion: Vector6::new(0.0, 0.0, 0.02 * RATE, 3.0 * 0.02 * RATE, 0.0, 0.0),
            }
        };
        let track = Track { states: (0..50).map(state).collect() };
        for k in 0..40 {
            let time = (f64::from(k) + 0.37) / RATE;
            let now = track.at(time).world_from_body;
            assert!((now.translation().norm() - 3.0).abs() < 1e-8);
            assert!((so3::angle(&now.rotation()) - 0.02 * time * RATE).abs() < 1e-12);
        }
        assert_eq!(track.at(0.1), track.states[10]);
    }
}
