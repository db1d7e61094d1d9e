//! The prior pose from navigation without images.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Body, Transform, World};

use super::{
    AcousticFix, LblFix, Readings, Sensors,
    attitude::AttitudeReading,
    fault::{DeviceFault, FaultyDevice, failed},
    lbl::Ranges,
    reading::TimedReading,
    trilateration::{Found, Length, trilaterate},
};
use crate::{scene::Scene, vehicle::Track};

/// Gate of a position fix, in standard deviations of its difference from dead reckoning.
const GATE: f64 = 4.0;

/// All readings of a dive, and the prior poses computed from them.
#[derive(Debug, Clone)]
pub(crate) struct SensorNavigation {
    sensors: Sensors,
    fixes: Vec<TimedReading<Vector3<f64>>>,
    answers: Vec<TimedReading<Ranges>>,
    /// All positions, in order of time.
    positions: Vec<TimedReading<Position>>,
    velocities: Vec<TimedReading<Vector3<f64>>>,
    attitudes: Vec<TimedReading<AttitudeReading>>,
    depths: Vec<TimedReading<f64>>,
}

/// The position of one part of the vehicle.
#[derive(Debug, Clone, Copy)]
struct Position {
    at: Vector3<f64>,
    /// Lever arm of that part in the body frame (m).
    lever: Vector3<f64>,
    /// Variance of the independent noise on each axis (m²).
    noise: Vector3<f64>,
    /// Covariance of the error that consecutive positions share (m²).
    common: Matrix3<f64>,
}

/// A pose with the covariance of its position (world, m²) and the deviation of its attitude (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensorPrior {
    pub(crate) world_from_body: Transform<World, Body>,
    pub(crate) position: Matrix3<f64>,
    pub(crate) attitude: f64,
}

/// The last reading that has arrived at a time.
fn latest<V>(readings: &[TimedReading<V>], now: f64) -> Option<&TimedReading<V>> {
    readings.iter().rev().find(|r| r.arrival <= now && r.time <= now)
}

impl SensorNavigation {
    pub(crate) fn new(
        sensors: &Sensors,
        faults: &[DeviceFault],
        track: &Track,
        scene: &Scene,
        until: f64,
        seeds: (u64, u64),
    ) -> Self {
        let mut all = Self {
            sensors: sensors.clone(),
            fixes: failed(sensors.acoustic.fixes(track, until, seeds), FaultyDevice::Acoustic, faults, seeds),
            answers: failed(sensors.lbl.answers(track, until, seeds), FaultyDevice::Lbl, faults, seeds),
            positions: Vec::new(),
            velocities: failed(
                sensors.doppler.readings(track, scene, until, seeds),
                FaultyDevice::Doppler,
                faults,
                seeds,
            ),
            attitudes: failed(sensors.attitude.readings(track, until, seeds), FaultyDevice::Attitude, faults, seeds),
            depths: failed(sensors.depth.readings(track, until, seeds), FaultyDevice::Depth, faults, seeds),
        };
        all.positions = all.positions();
        all
    }

    fn positions(&self) -> Vec<TimedReading<Position>> {
        let usbl = self.fixes.iter().map(|fix| {
            let noise = Vector3::repeat(self.spread(&fix.value).powi(2));
            let lever = Vector3::from(self.sensors.acoustic.at);
            let value = Position { at: fix.value, lever, noise, common: Matrix3::zeros() };
            TimedReading { time: fix.time, arrival: fix.arrival, value }
        });
        let lbl = self.answers.iter().filter_map(|answer| {
            let Found { at, noise, common } = self.among_transponders(answer)?;
            let lever = Vector3::from(self.sensors.lbl.at);
            let value = Position { at, lever, noise: noise.diagonal(), common };
            Some(TimedReading { time: answer.time, arrival: answer.arrival, value })
        });
        let mut all: Vec<_> = usbl.chain(lbl).collect();
        all.sort_by(|a, b| a.time.total_cmp(&b.time));
        all
    }

    /// The interrogator's position from the replies and the depth gauge.
    fn among_transponders(&self, answer: &TimedReading<Ranges>) -> Option<Found> {
        let lbl = &self.sensors.lbl;
        let length =
            |range: f64| Length { value: range, noise: lbl.sigma, common: lbl.survey.hypot(lbl.sound * range) };
        let places = lbl.transponders.iter().map(|t| Vector3::from(*t));
        let ranges: Vec<_> =
            places.clone().zip(answer.value.0).filter_map(|(t, range)| Some((t, length(range?)))).collect();
        let depth = latest(&self.depths, answer.arrival).map(|message| {
            let turn = self.turned(message.time).map(|message| message.world_from_body).unwrap_or_default();
            let between = (turn * (Vector3::from(lbl.at) - Vector3::from(self.sensors.depth.at))).z;
            let gauge = &self.sensors.depth;
            // The vehicle may have risen or sunk since the depth reading, at up to 0.1 m/s.
            let slow = 0.1 * (answer.time - message.time);
            Length { value: message.value + between, noise: gauge.sigma.hypot(slow), common: gauge.bias }
        });
        let middle = places.clone().sum::<Vector3<f64>>() / lbl.transponders.len().max(1) as f64;
        // Transponders stand on the seabed, so the vehicle is above them.
        let highest = places.map(|t| t.z).fold(f64::INFINITY, f64::min);
        let start = Vector3::new(middle.x, middle.y, depth.map_or(highest - 3.0, |depth| depth.value));
        trilaterate(&ranges, depth, start)
    }

    /// All readings, as [`Readings`].
    pub(crate) fn readings(&self) -> Readings {
        let fix = |fix: &TimedReading<Vector3<f64>>| TimedReading {
            time: fix.time,
            arrival: fix.arrival,
            value: AcousticFix { at: fix.value, sigma: self.spread(&fix.value) },
        };
        let lbl = |answer: &TimedReading<Ranges>| {
            let fix = self.among_transponders(answer);
            let fix = fix.map(|f| LblFix { at: f.at, sigma: (f.noise + f.common).diagonal().map(f64::sqrt) });
            TimedReading { time: answer.time, arrival: answer.arrival, value: (answer.value, fix) }
        };
        Readings {
            acoustic: self.fixes.iter().map(fix).collect(),
            lbl: self.answers.iter().map(lbl).collect(),
            doppler: self.velocities.clone(),
            attitude: self.attitudes.clone(),
            depth: self.depths.clone(),
        }
    }

    /// Standard deviation of each axis of an acoustic position at its own range.
    fn spread(&self, at: &Vector3<f64>) -> f64 {
        let range = (at - Vector3::from(self.sensors.acoustic.from)).norm();
        self.sensors.acoustic.spread(range).max(1e-3)
    }

    /// The latest attitude reading measured at or before a time.
    fn turned(&self, time: f64) -> Option<&AttitudeReading> {
        self.attitudes.partition_point(|a| a.time <= time).checked_sub(1).map(|k| &self.attitudes[k].value)
    }

    /// The vehicle's position at the time of a position of one of its parts.
    fn place(&self, position: &TimedReading<Position>) -> Vector3<f64> {
        let turn = self.turned(position.time).map(|message| message.world_from_body).unwrap_or_default();
        position.value.at - turn * position.value.lever
    }

    /// The prior pose at a time (s); `None` before the first position.
    ///
    /// A Kalman filter for each axis separately, whose states are the position and the drift per metre travelled.
    /// Doppler velocity and attitude predict, acoustic positions correct, and the gauge gives the depth. The drift is a
    /// state because heading and scale errors persist over the path, which step noise would not model. The error that
    /// all positions share is no noise; it is added at the end.
    pub(crate) fn at(&self, now: f64) -> Option<SensorPrior> {
        let attitude = latest(&self.attitudes, now)?;
        let mut positions = self.positions.iter().filter(|position| position.arrival <= now);
        let first = positions.next()?;
        let heading = self.sensors.attitude.heading_deg.to_radians();
        let level = self.sensors.attitude.level_deg.to_radians();
        let doppler = &self.sensors.doppler;
        let drift = doppler.scale.powi(2) + heading * heading + level * level;
        let noise = doppler.sigma.powi(2) / doppler.rate;
        // Position, drift, and their variances on each axis: (position, covariance, drift).
        let (mut at, mut slope, mut time) = (self.place(first), Vector3::zeros(), first.time);
        let mut p = [0, 1, 2].map(|k| [first.value.noise[k], 0.0, drift]);
        let mut common = first.value.common;
        let travel = |at: &mut Vector3<f64>, slope: &Vector3<f64>, p: &mut [[f64; 3]; 3], from: f64, to: f64| {
            let (step, length) = self.travelled(from, to);
            *at += step + slope * length;
            for p in p {
                *p = [
                    p[0] + 2.0 * length * p[1] + length * length * p[2] + noise * (to - from).max(0.0),
                    p[1] + length * p[2],
                    p[2],
                ];
            }
        };
        for position in positions {
            travel(&mut at, &slope, &mut p, time, position.time);
            time = position.time;
            let here = &position.value;
            let total = Vector3::from_fn(|k, _| p[k][0] + here.noise[k]);
            let miss = self.place(position) - at;
            // Squares over variances, scaled by the first axis' variance: equal axes lose no digit.
            let allowed = total + here.common.diagonal() + common.diagonal();
            let scaled = Vector3::from_fn(|k, _| miss[k] * (allowed[0] / allowed[k]));
            if miss.dot(&scaled) < GATE * GATE * 3.0 * allowed[0] {
                let before = p;
                for k in 0..3 {
                    let gains = [p[k][0] / total[k], p[k][1] / total[k]];
                    at[k] += miss[k] * gains[0];
                    slope[k] += miss[k] * gains[1];
                    p[k] = [p[k][0] * (1.0 - gains[0]), p[k][1] * (1.0 - gains[0]), p[k][2] - gains[1] * p[k][1]];
                }
                // The shared error enters with at most the gain of the position.
                let gain = Vector3::from_fn(|k, _| before[k][0] / total[k]).mean();
                common = common * (1.0 - gain) + here.common * gain;
            }
        }
        travel(&mut at, &slope, &mut p, time, now);
        let mut position = Matrix3::from_diagonal(&Vector3::from_fn(|k, _| p[k][0])) + common;
        if let Some(depth) = latest(&self.depths, now) {
            at.z = depth.value - (attitude.value.world_from_body * Vector3::from(self.sensors.depth.at)).z;
            // The vehicle may have risen or sunk since the depth reading, at up to 0.1 m/s.
            let slow = (0.1 * (now - depth.time)).powi(2);
            position.row_mut(2).fill(0.0);
            position.column_mut(2).fill(0.0);
            position[(2, 2)] = self.sensors.depth.bias.powi(2) + self.sensors.depth.sigma.powi(2) + slow;
        }
        let sensor = &self.sensors.attitude;
        let squares = sensor.heading_deg.powi(2) + 2.0 * sensor.level_deg.powi(2);
        let attitude_sigma = (squares / 3.0 + sensor.sigma_deg.powi(2)).sqrt().to_radians();
        let world_from_body = Transform::new(attitude.value.world_from_body, at);
        Some(SensorPrior { world_from_body, position, attitude: attitude_sigma.max(1e-5) })
    }

    /// Displacement between two times by Doppler and attitude (m), and the path length (m).
    fn travelled(&self, from: f64, to: f64) -> (Vector3<f64>, f64) {
        let (mut sum, mut length) = (Vector3::zeros(), 0.0);
        let mut last = from;
        let mut ping = self.velocities.partition_point(|v| v.time < from);
        while last < to {
            let next = self.velocities.get(ping).map_or(to, |v| v.time).min(to);
            // The last velocity holds until a new ping arrives.
            let Some(velocity) = self.velocities[..ping.min(self.velocities.len())].last().or(self.velocities.first())
            else {
                break;
            };
            let (turn, rate) =
                self.turned(last).map(|message| (message.world_from_body, message.rate)).unwrap_or_default();
            let lever = rate.cross(&Vector3::from(self.sensors.doppler.at));
            let step = turn * (velocity.value - lever) * (next - last);
            sum += step;
            length += step.norm();
            (last, ping) = (next, ping + 1);
        }
        (sum, length)
    }
}
