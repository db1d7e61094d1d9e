//! The odometry at work.

use std::time::Instant;

use nalgebra::{Matrix4, Matrix6, SVector, Vector4};
use seafix_geometry::{Body, Camera, Covariance6, Transform};

use super::{
    DvlGyro,
    integral::{Heard, Place},
    signal::{Signal, seconds},
};
use crate::{
    Device, Journey, Lasting, Local, Lost, NotAfter, Outcome, Reading, Reckoning, Segment, StereoPair, Waypoint,
    lasting::{LASTING, Shares, Spread},
    odometry::Stamps,
};

/// The memory of one journey.
pub(super) struct DeadReckoning<'a> {
    settings: &'a DvlGyro,
    body_from_camera: Transform<Body, Camera>,
    heard: Heard,
    stamps: Stamps,
    /// A place so long ago that no reading can come any more that would change it.
    base: Place,
    /// The last place that was told, and up to when each device was known then.
    last: Option<(Place, [u64; 2])>,
    segments: Vec<Segment>,
    outcomes: Vec<Outcome>,
    reckon_ms: f64,
}

impl Reckoning for DeadReckoning<'_> {
    fn sense(&mut self, reading: &Reading) {
        let (signal, most) = match reading.device {
            Device::Doppler => (&mut self.heard.doppler, self.settings.most_speed),
            Device::Gyro => (&mut self.heard.gyro, self.settings.most_turn_deg.to_radians()),
        };
        // What is not a number is not below anything.
        let believable = reading.value.norm() <= most && reading.covariance.iter().all(|x| x.is_finite());
        if believable && reading.stamp_ns >= self.base.stamp_ns {
            signal.insert(*reading);
        }
    }

    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<Outcome, NotAfter> {
        let stamp_ns = pair.stamp_ns;
        self.stamps.take(self.outcomes.len(), stamp_ns)?;
        let start = Instant::now();
        let outcome = match self.last {
            None => self.begin(stamp_ns, None),
            Some((last, known)) => self.follow(stamp_ns, &last, known),
        };
        self.outcomes.push(outcome.clone());
        self.reckon_ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(outcome)
    }

    fn latest(&self) -> Option<(usize, Waypoint)> {
        let number = self.segments.len().checked_sub(1)?;
        Some((number, *self.segments[number].poses.last()?))
    }

    fn journey(&self) -> Journey {
        Journey {
            segments: self.segments.clone(),
            outcomes: self.outcomes.clone(),
            times: vec![("reckon", self.reckon_ms)],
        }
    }
}

impl<'a> DeadReckoning<'a> {
    pub(super) fn new(settings: &'a DvlGyro, body_from_camera: Transform<Body, Camera>) -> Self {
        Self {
            settings,
            body_from_camera,
            heard: Heard::default(),
            stamps: Stamps::default(),
            base: Place::new(0, Transform::identity()),
            last: None,
            segments: Vec::new(),
            outcomes: Vec::new(),
            reckon_ms: 0.0,
        }
    }

    /// Begins a segment where the one before ended.
    fn begin(&mut self, stamp_ns: u64, broken: Option<Lost>) -> Outcome {
        let here = self.last.map_or_else(Transform::identity, |(last, _)| last.start_from_body);
        self.base = Place::new(stamp_ns, here);
        self.last = Some((self.base, [stamp_ns; 2]));
        self.segments.push(Segment { broken, poses: vec![self.waypoint(&self.base, None)] });
        Outcome::Began
    }

    /// The way from the last place to `now`.
    fn follow(&mut self, now: u64, last: &Place, known: [u64; 2]) -> Outcome {
        let most = self.settings.most_gap;
        let devices = [(Device::Doppler, &self.heard.doppler), (Device::Gyro, &self.heard.gyro)];
        let silent = |&(device, signal): &(Device, &Signal)| {
            let seconds = signal.silence(last.stamp_ns, now);
            (seconds > most || signal.latest().is_none()).then_some(Lost::Silent { device, seconds, most })
        };
        if let Some(lost) = devices.iter().find_map(silent) {
            let heard = |signal: &Signal| signal.latest().is_some_and(|latest| seconds(latest, now) <= most);
            return match devices.iter().all(|(_, signal)| heard(signal)) {
                true => self.begin(now, Some(lost)),
                false => Outcome::Skipped(lost),
            };
        }
        let here = self.heard.carry(&self.base, now, known, self.settings).expect("both devices were heard");
        let local = self.local(last, &here);
        let waypoint = self.waypoint(&here, Some(local));
        self.segments.last_mut().expect("a segment was begun").poses.push(waypoint);
        let latest = devices.map(|(_, signal)| signal.latest().unwrap_or_default());
        self.last = Some((here, [0, 1].map(|k| latest[k].clamp(known[k], now))));
        self.settle(now);
        Outcome::Followed { sought: 0, found: 0 }
    }

    /// The motion from one place to a later one.
    fn local(&self, last: &Place, here: &Place) -> Local {
        let motion = last.start_from_body.inverse() * here.start_from_body;
        let across = motion.inverse().adjoint();
        let by = here.by - across * last.by;
        let (scale, bias) = (self.settings.scale.powi(2), (self.settings.instability.to_radians() / 3600.0).powi(2));
        let independent = Vector4::new(scale, bias, bias, bias);
        let lasting = Matrix4::from_diagonal(&independent);
        let fades = libm::exp(-seconds(last.stamp_ns, here.stamp_ns) / self.settings.tau);
        let own: Matrix6<f64> = here.settled + here.held + across * last.held * across.transpose();

        let camera_from_body = self.body_from_camera.inverse();
        let to_camera = camera_from_body.adjoint();
        let covariance = to_camera * (by * lasting * by.transpose() + own) * to_camera.transpose();
        let (mut shares, mut with) = (Shares::zeros(), Shares::zeros());
        shares.fixed_view_mut::<6, 4>(0, 0).copy_from(&by);
        shares.fixed_view_mut::<6, 6>(0, 4).copy_from(&-across);
        let keep = Vector4::new(1.0, fades, fades, fades);
        with.fixed_view_mut::<6, 4>(0, 0).copy_from(&(by * lasting * Matrix4::from_diagonal(&keep)));
        with.fixed_view_mut::<6, 6>(0, 4).copy_from(&here.held);
        // What was held is known by the next pair.
        let keep = SVector::<f64, LASTING>::from_fn(|k, _| if k < 4 { keep[k] } else { 0.0 });
        Local {
            motion: camera_from_body * motion * self.body_from_camera,
            covariance: Covariance6::new(covariance),
            lasting: Some(Lasting {
                by: to_camera * shares,
                keep,
                with: to_camera * with,
                before: Spread { independent, held: last.held },
                after: Spread { independent, held: here.held },
            }),
        }
    }

    /// Moves the base on, and forgets what is behind it.
    fn settle(&mut self, now: u64) {
        let to = now.saturating_sub((self.settings.most_gap * 1e9) as u64);
        if to <= self.base.stamp_ns {
            return;
        }
        if let Some(base) = self.heard.carry(&self.base, to, [to; 2], self.settings) {
            self.base = Place { settled: Matrix6::zeros(), held: Matrix6::zeros(), ..base };
            self.heard.doppler.forget(to);
            self.heard.gyro.forget(to);
        }
    }

    /// What is told of a place: the camera, the world being that of the first pair.
    fn waypoint(&self, place: &Place, local: Option<Local>) -> Waypoint {
        let world_from_camera =
            (self.body_from_camera.inverse() * place.start_from_body * self.body_from_camera).relabel();
        Waypoint { stamp_ns: place.stamp_ns, world_from_camera, local }
    }
}
