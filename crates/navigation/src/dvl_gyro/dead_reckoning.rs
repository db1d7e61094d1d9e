//! The session of dead reckoning.

use std::time::Instant;

use nalgebra::{Matrix4, Matrix6, SVector, Vector4};
use seafix_geometry::{Body, Camera, Covariance6, Transform};

use super::{
    integral::{DeviceSignals, IntegratedPose},
    settings::DvlGyro,
    signal::{Signal, seconds},
};
use crate::{
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedError, CorrelatedSensitivities},
    odometry::{NotAfter, OdometrySession, Stamps, StereoPair},
    odometry_trajectory::{Lost, OdometryOutcome, OdometryTrajectory, RelativeMotion, Segment, Waypoint},
    reading::{Device, Reading},
};

/// The state of one session.
pub(super) struct DeadReckoning<'a> {
    settings: &'a DvlGyro,
    body_from_camera: Transform<Body, Camera>,
    signals: DeviceSignals,
    stamps: Stamps,
    /// A pose old enough that no late reading can change it.
    base: IntegratedPose,
    /// The last reported pose, and the time up to which each device was known then.
    last: Option<(IntegratedPose, [u64; 2])>,
    segments: Vec<Segment>,
    outcomes: Vec<OdometryOutcome>,
    integrate_ms: f64,
}

impl OdometrySession for DeadReckoning<'_> {
    fn sense(&mut self, reading: &Reading) {
        let (signal, max) = match reading.device {
            Device::Doppler => (&mut self.signals.doppler, self.settings.max_speed),
            Device::Gyro => (&mut self.signals.gyro, self.settings.max_turn_deg.to_radians()),
        };
        // The comparison is false for NaN.
        let believable = reading.value.norm() <= max && reading.covariance.iter().all(|x| x.is_finite());
        if believable && reading.stamp_ns >= self.base.stamp_ns {
            signal.insert(*reading);
        }
    }

    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<OdometryOutcome, NotAfter> {
        let stamp_ns = pair.stamp_ns;
        self.stamps.take(self.outcomes.len(), stamp_ns)?;
        let start = Instant::now();
        let outcome = match self.last {
            None => self.begin(stamp_ns, None),
            Some((last, known)) => self.follow(stamp_ns, &last, known),
        };
        self.outcomes.push(outcome.clone());
        self.integrate_ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(outcome)
    }

    fn latest(&self) -> Option<(usize, Waypoint)> {
        let number = self.segments.len().checked_sub(1)?;
        Some((number, *self.segments[number].poses.last()?))
    }

    fn trajectory(&self) -> OdometryTrajectory {
        OdometryTrajectory {
            segments: self.segments.clone(),
            outcomes: self.outcomes.clone(),
            times: vec![("reckon", self.integrate_ms)],
        }
    }
}

impl<'a> DeadReckoning<'a> {
    pub(super) fn new(settings: &'a DvlGyro, body_from_camera: Transform<Body, Camera>) -> Self {
        Self {
            settings,
            body_from_camera,
            signals: DeviceSignals::default(),
            stamps: Stamps::default(),
            base: IntegratedPose::new(0, Transform::identity()),
            last: None,
            segments: Vec::new(),
            outcomes: Vec::new(),
            integrate_ms: 0.0,
        }
    }

    /// Begins a segment at the pose where the previous one ended.
    fn begin(&mut self, stamp_ns: u64, broken: Option<Lost>) -> OdometryOutcome {
        let here = self.last.map_or_else(Transform::identity, |(last, _)| last.start_from_body);
        self.base = IntegratedPose::new(stamp_ns, here);
        self.last = Some((self.base, [stamp_ns; 2]));
        self.segments.push(Segment { broken, poses: vec![self.waypoint(&self.base, None)] });
        OdometryOutcome::Began
    }

    /// The motion from the last pose to the time `now`.
    fn follow(&mut self, now: u64, last: &IntegratedPose, known: [u64; 2]) -> OdometryOutcome {
        let max = self.settings.max_gap;
        let devices = [(Device::Doppler, &self.signals.doppler), (Device::Gyro, &self.signals.gyro)];
        let silent = |&(device, signal): &(Device, &Signal)| {
            let seconds = signal.silence(last.stamp_ns, now);
            (seconds > max || signal.latest().is_none()).then_some(Lost::Silent { device, seconds, max })
        };
        if let Some(lost) = devices.iter().find_map(silent) {
            let signals = |signal: &Signal| signal.latest().is_some_and(|latest| seconds(latest, now) <= max);
            return match devices.iter().all(|(_, signal)| signals(signal)) {
                true => self.begin(now, Some(lost)),
                false => OdometryOutcome::Skipped(lost),
            };
        }
        let here = self.signals.carry(&self.base, now, known, self.settings).expect("both devices have readings");
        let local = self.local(last, &here);
        let waypoint = self.waypoint(&here, Some(local));
        self.segments.last_mut().expect("a segment was begun").poses.push(waypoint);
        let latest = devices.map(|(_, signal)| signal.latest().unwrap_or_default());
        self.last = Some((here, [0, 1].map(|k| latest[k].clamp(known[k], now))));
        self.settle(now);
        OdometryOutcome::Followed { sought: 0, found: 0 }
    }

    /// The motion between two integrated poses, with its correlated errors.
    fn local(&self, last: &IntegratedPose, here: &IntegratedPose) -> RelativeMotion {
        let motion = last.start_from_body.inverse() * here.start_from_body;
        let across = motion.inverse().adjoint();
        let by = here.by - across * last.by;
        let (scale, bias) = (self.settings.scale.powi(2), (self.settings.instability.to_radians() / 3600.0).powi(2));
        let independent = Vector4::new(scale, bias, bias, bias);
        let correlated = Matrix4::from_diagonal(&independent);
        let fades = libm::exp(-seconds(last.stamp_ns, here.stamp_ns) / self.settings.tau);
        let own: Matrix6<f64> = here.settled + here.held + across * last.held * across.transpose();

        let camera_from_body = self.body_from_camera.inverse();
        let to_camera = camera_from_body.adjoint();
        let covariance = to_camera * (by * correlated * by.transpose() + own) * to_camera.transpose();
        let (mut sensitivities, mut with) = (CorrelatedSensitivities::zeros(), CorrelatedSensitivities::zeros());
        sensitivities.fixed_view_mut::<6, 4>(0, 0).copy_from(&by);
        sensitivities.fixed_view_mut::<6, 6>(0, 4).copy_from(&-across);
        let keep = Vector4::new(1.0, fades, fades, fades);
        with.fixed_view_mut::<6, 4>(0, 0).copy_from(&(by * correlated * Matrix4::from_diagonal(&keep)));
        with.fixed_view_mut::<6, 6>(0, 4).copy_from(&here.held);
        // Extrapolation errors last for one step only; the next pair has the late readings.
        let keep = SVector::<f64, CORRELATED>::from_fn(|k, _| if k < 4 { keep[k] } else { 0.0 });
        RelativeMotion {
            motion: camera_from_body * motion * self.body_from_camera,
            covariance: Covariance6::new(covariance),
            correlated: Some(CorrelatedError {
                by: to_camera * sensitivities,
                keep,
                with: to_camera * with,
                before: CorrelatedCovariance { independent, held: last.held },
                after: CorrelatedCovariance { independent, held: here.held },
            }),
        }
    }

    /// Advances the base pose and drops older readings.
    fn settle(&mut self, now: u64) {
        let to = now.saturating_sub((self.settings.max_gap * 1e9) as u64);
        if to <= self.base.stamp_ns {
            return;
        }
        if let Some(base) = self.signals.carry(&self.base, to, [to; 2], self.settings) {
            self.base = IntegratedPose { settled: Matrix6::zeros(), held: Matrix6::zeros(), ..base };
            self.signals.doppler.forget(to);
            self.signals.gyro.forget(to);
        }
    }

    /// The waypoint of an integrated pose; the world is the camera's frame at the first pair.
    fn waypoint(&self, place: &IntegratedPose, local: Option<RelativeMotion>) -> Waypoint {
        let world_from_camera =
            (self.body_from_camera.inverse() * place.start_from_body * self.body_from_camera).relabel();
        Waypoint { stamp_ns: place.stamp_ns, world_from_camera, local }
    }
}
