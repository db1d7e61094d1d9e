//! The rough pose that navigation without images gives.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Body, Transform, World};

use super::{
    AcousticFix, AttitudeReading, Reading, Readings, Sensors,
    fault::{Device, DeviceFault, failed},
};
use crate::{field::Field, vehicle::Track};

/// Fixes farther from the dead-reckoned place than this many standard deviations are not believed.
const GATE: f64 = 4.0;

/// All readings of a dive, and the poses they give.
#[derive(Debug, Clone)]
pub(crate) struct Navigation {
    sensors: Sensors,
    fixes: Vec<Reading<Vector3<f64>>>,
    velocities: Vec<Reading<Vector3<f64>>>,
    attitudes: Vec<Reading<AttitudeReading>>,
    depths: Vec<Reading<f64>>,
}

/// A pose with standard deviations: position covariance in the world (m²), attitude each axis (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rough {
    pub(crate) world_from_body: Transform<World, Body>,
    pub(crate) position: Matrix3<f64>,
    pub(crate) attitude: f64,
}

/// The last reading that is there at a time.
fn latest<V>(readings: &[Reading<V>], now: f64) -> Option<&Reading<V>> {
    readings.iter().rev().find(|r| r.arrival <= now && r.time <= now)
}

impl Navigation {
    pub(crate) fn new(
        sensors: &Sensors,
        faults: &[DeviceFault],
        track: &Track,
        field: &Field,
        until: f64,
        seeds: (u64, u64),
    ) -> Self {
        Self {
            sensors: sensors.clone(),
            fixes: failed(sensors.acoustic.fixes(track, until, seeds), Device::Acoustic, faults, seeds),
            velocities: failed(sensors.doppler.readings(track, field, until, seeds), Device::Doppler, faults, seeds),
            attitudes: failed(sensors.attitude.readings(track, until, seeds), Device::Attitude, faults, seeds),
            depths: failed(sensors.depth.readings(track, until, seeds), Device::Depth, faults, seeds),
        }
    }

    /// Everything that was said.
    pub(crate) fn readings(&self) -> Readings {
        let fix = |fix: &Reading<Vector3<f64>>| Reading {
            time: fix.time,
            arrival: fix.arrival,
            value: AcousticFix { at: fix.value, sigma: self.spread(&fix.value) },
        };
        Readings {
            acoustic: self.fixes.iter().map(fix).collect(),
            doppler: self.velocities.clone(),
            attitude: self.attitudes.clone(),
            depth: self.depths.clone(),
        }
    }

    /// The standard deviation of each axis of an acoustic position, by its own range.
    fn spread(&self, at: &Vector3<f64>) -> f64 {
        let range = (at - Vector3::from(self.sensors.acoustic.from)).norm();
        self.sensors.acoustic.spread(range).max(1e-3)
    }

    /// The attitude reading that was last made at a time.
    fn turned(&self, time: f64) -> Option<&AttitudeReading> {
        self.attitudes.partition_point(|a| a.time <= time).checked_sub(1).map(|k| &self.attitudes[k].value)
    }

    /// The vehicle's place when its transponder was at a fix.
    fn place(&self, fix: &Reading<Vector3<f64>>) -> Vector3<f64> {
        let turn = self.turned(fix.time).map(|said| said.world_from_body).unwrap_or_default();
        fix.value - turn * Vector3::from(self.sensors.acoustic.at)
    }

    /// The pose at a time (s): the acoustic fixes that are there, carried on by Doppler velocity and attitude,
    /// each new one weighed with what was known; the depth from the gauge. `None` before the first fix.
    ///
    /// A Kalman filter of the position and of the drift for each metre travelled, each axis for itself:
    /// heading and scale err alike all the way, which noise of the steps would not say.
    pub(crate) fn at(&self, now: f64) -> Option<Rough> {
        let attitude = latest(&self.attitudes, now)?;
        let mut fixes = self.fixes.iter().filter(|fix| fix.arrival <= now);
        let first = fixes.next()?;
        let heading = self.sensors.attitude.heading_deg.to_radians();
        let level = self.sensors.attitude.level_deg.to_radians();
        let doppler = &self.sensors.doppler;
        let drift = doppler.scale.powi(2) + heading * heading + level * level;
        let noise = doppler.sigma.powi(2) / doppler.rate;
        // Position, drift, and their variances: (position, both, drift).
        let (mut at, mut slope, mut time) = (self.place(first), Vector3::zeros(), first.time);
        let mut p = [self.spread(&first.value).powi(2), 0.0, drift];
        let travel = |at: &mut Vector3<f64>, slope: &Vector3<f64>, p: &mut [f64; 3], from: f64, to: f64| {
            let (step, length) = self.travelled(from, to);
            *at += step + slope * length;
            *p = [
                p[0] + 2.0 * length * p[1] + length * length * p[2] + noise * (to - from).max(0.0),
                p[1] + length * p[2],
                p[2],
            ];
        };
        for fix in fixes {
            travel(&mut at, &slope, &mut p, time, fix.time);
            time = fix.time;
            let total = p[0] + self.spread(&fix.value).powi(2);
            let miss = self.place(fix) - at;
            if miss.norm_squared() < GATE * GATE * 3.0 * total {
                let gains = [p[0] / total, p[1] / total];
                (at, slope) = (at + miss * gains[0], slope + miss * gains[1]);
                p = [p[0] * (1.0 - gains[0]), p[1] * (1.0 - gains[0]), p[2] - gains[1] * p[1]];
            }
        }
        travel(&mut at, &slope, &mut p, time, now);
        let variance = p[0];
        let mut position = Matrix3::from_diagonal_element(variance);
        if let Some(depth) = latest(&self.depths, now) {
            at.z = depth.value - (attitude.value.world_from_body * Vector3::from(self.sensors.depth.at)).z;
            // Between reading and now it rises and sinks slowly.
            let slow = (0.1 * (now - depth.time)).powi(2);
            position[(2, 2)] = self.sensors.depth.bias.powi(2) + self.sensors.depth.sigma.powi(2) + slow;
        }
        let sensor = &self.sensors.attitude;
        let squares = sensor.heading_deg.powi(2) + 2.0 * sensor.level_deg.powi(2);
        let attitude_sigma = (squares / 3.0 + sensor.sigma_deg.powi(2)).sqrt().to_radians();
        let world_from_body = Transform::new(attitude.value.world_from_body, at);
        Some(Rough { world_from_body, position, attitude: attitude_sigma.max(1e-5) })
    }

    /// How far the vehicle went between two times by Doppler and attitude (m): the step, and the length.
    fn travelled(&self, from: f64, to: f64) -> (Vector3<f64>, f64) {
        let (mut sum, mut length) = (Vector3::zeros(), 0.0);
        let mut last = from;
        let mut ping = self.velocities.partition_point(|v| v.time < from);
        while last < to {
            let next = self.velocities.get(ping).map_or(to, |v| v.time).min(to);
            // Without a new ping the last velocity goes on.
            let Some(velocity) = self.velocities[..ping.min(self.velocities.len())].last().or(self.velocities.first())
            else {
                break;
            };
            let (turn, rate) = self.turned(last).map(|said| (said.world_from_body, said.rate)).unwrap_or_default();
            let lever = rate.cross(&Vector3::from(self.sensors.doppler.at));
            let step = turn * (velocity.value - lever) * (next - last);
            sum += step;
            length += step.norm();
            (last, ping) = (next, ping + 1);
        }
        (sum, length)
    }
}
