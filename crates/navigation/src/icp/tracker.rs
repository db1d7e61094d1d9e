//! The session of ICP odometry.

use std::time::Instant;

use nalgebra::{Matrix6, SVector, Vector4};
use seafix_geometry::{Camera, Covariance6, StereoRig, Transform, World};
use seafix_vision::{FrontEnd, FrontEndOutput, Threads};

use super::{
    align::{Ground, Registered},
    settings::Icp,
};
use crate::{
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedError, CorrelatedSensitivities},
    odometry::{NotAfter, OdometrySession, Stamps, StereoPair},
    odometry_trajectory::{Lost, OdometryOutcome, OdometryTrajectory, RelativeMotion, Segment, Waypoint},
    times::Times,
    unusable::RawImages,
};

/// The state of one session.
pub(super) struct IcpTracker<'a> {
    settings: &'a Icp,
    front_end: FrontEnd,
    rig: &'a StereoRig,
    output: FrontEndOutput,
    stamps: Stamps,
    raw: RawImages,
    /// The key frame: its cloud and its pose.
    key: Option<(Ground, Transform<World, Camera>)>,
    last: Option<Last>,
    /// A cloud that could not be registered: the cloud, its stamp, its index among the outcomes, the reason.
    pending: Option<(Ground, u64, usize, Lost)>,
    /// The reason of the last break, until a usable cloud begins the next segment.
    broken: Option<Lost>,
    segments: Vec<Segment>,
    outcomes: Vec<OdometryOutcome>,
    times: Times,
}

/// The last registered cloud, relative to the key frame.
struct Last {
    stamp_ns: u64,
    key_from_camera: Transform<Camera, Camera>,
    /// Covariance of that pose; zero for the key frame itself.
    covariance: Covariance6<Camera, Camera>,
    /// The previous motion and its duration (s).
    motion: Option<(Transform<Camera, Camera>, f64)>,
}

/// The motion from the last cloud to a new one.
struct Step {
    registered: Registered,
    motion: Transform<Camera, Camera>,
    seconds: f64,
}

impl OdometrySession for IcpTracker<'_> {
    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<OdometryOutcome, NotAfter> {
        let stamp_ns = pair.stamp_ns;
        self.stamps.take(self.outcomes.len(), stamp_ns)?;
        let start = Instant::now();
        if let Some(lost) = self.raw.take([pair.left, pair.right]) {
            self.outcomes.push(OdometryOutcome::Skipped(lost.clone()));
            return Ok(OdometryOutcome::Skipped(lost));
        }
        self.times.since("check", start);
        self.front_end.run(pair.left, pair.right, self.rig, &mut self.output);
        for (stage, ms) in self.output.times.stages() {
            self.times.add(stage, ms);
        }
        let start = Instant::now();
        let ground = Ground::new(self.settings, &self.output.cloud);
        self.take(ground, stamp_ns);
        self.times.since("register", start);
        Ok(self.outcomes.last().cloned().expect("every pair has an outcome"))
    }

    fn latest(&self) -> Option<(usize, Waypoint)> {
        let number = self.segments.len().checked_sub(1)?;
        Some((number, *self.segments[number].poses.last()?))
    }

    fn trajectory(&self) -> OdometryTrajectory {
        OdometryTrajectory {
            segments: self.segments.clone(),
            outcomes: self.outcomes.clone(),
            times: self.times.0.clone(),
        }
    }
}

impl<'a> IcpTracker<'a> {
    pub(super) fn new(settings: &'a Icp, front_end: FrontEnd, rig: &'a StereoRig, threads: Threads) -> Self {
        Self {
            settings,
            front_end,
            rig,
            output: FrontEndOutput::new(threads),
            stamps: Stamps::default(),
            raw: RawImages::default(),
            key: None,
            last: None,
            pending: None,
            broken: None,
            segments: Vec::new(),
            outcomes: Vec::new(),
            times: Times::default(),
        }
    }

    /// Processes a cloud: it continues the segment or begins a new one.
    fn take(&mut self, ground: Ground, stamp_ns: u64) {
        match self.follow(&ground, stamp_ns) {
            None => {
                let outcome = self.begin(ground, stamp_ns, None);
                self.outcomes.push(outcome);
            }
            Some(Ok(step)) => {
                // A single cloud between that failed was an outlier.
                self.pending = None;
                self.outcomes.push(OdometryOutcome::Followed { sought: ground.len(), found: step.registered.partners });
                self.accept(ground, stamp_ns, &step);
            }
            Some(Err(lost)) => match (self.pending.take(), lost) {
                // Two successive failures: a new segment begins with the first of the two clouds.
                (Some((first, when, index, why)), _) => {
                    self.outcomes[index] = self.begin(first, when, Some(why));
                    self.take(ground, stamp_ns);
                }
                (None, lost @ Lost::Gap { .. }) => {
                    let outcome = self.begin(ground, stamp_ns, Some(lost));
                    self.outcomes.push(outcome);
                }
                (None, lost) => {
                    self.pending = Some((ground, stamp_ns, self.outcomes.len(), lost.clone()));
                    self.outcomes.push(OdometryOutcome::Skipped(lost));
                }
            },
        }
    }

    /// Begins a segment at the pose where the previous one ended.
    fn begin(&mut self, ground: Ground, stamp_ns: u64, broken: Option<Lost>) -> OdometryOutcome {
        let broken = self.broken.take().or(broken);
        (self.key, self.last) = (None, None);
        let (found, needed) = (ground.len(), self.settings.min_points);
        if found < needed {
            // The reason is kept until a usable cloud begins the segment.
            self.broken = broken;
            return OdometryOutcome::Skipped(Lost::FewPoints { found, needed });
        }
        let here = self.latest().map_or_else(Transform::identity, |(_, last)| last.world_from_camera);
        self.segments
            .push(Segment { broken, poses: vec![Waypoint { stamp_ns, world_from_camera: here, local: None }] });
        self.key = Some((ground, here));
        self.last = Some(Last {
            stamp_ns,
            key_from_camera: Transform::identity(),
            covariance: Covariance6::isotropic(0.0, 0.0),
            motion: None,
        });
        OdometryOutcome::Began
    }

    /// The motion to a cloud; `None` before the first segment.
    fn follow(&self, ground: &Ground, stamp_ns: u64) -> Option<Result<Step, Lost>> {
        let ((key, _), last) = (self.key.as_ref()?, self.last.as_ref()?);
        Some(registered(self.settings, key, last, ground, stamp_ns))
    }

    /// Adds a cloud to the trajectory.
    fn accept(&mut self, ground: Ground, stamp_ns: u64, step: &Step) {
        let &Step { registered, motion, seconds } = step;
        let (Some((key, world_from_key)), Some(last)) = (&self.key, &self.last) else { return };
        let world_from_camera = (*world_from_key * registered.key_from_now).renormalized();
        // Both poses refer to one key frame, so this step cancels the error of the last pose.
        let across = motion.inverse().adjoint();
        let before = last.covariance.matrix;
        let (mut by, mut with) = (CorrelatedSensitivities::zeros(), CorrelatedSensitivities::zeros());
        by.fixed_view_mut::<6, 6>(0, 4).copy_from(&-across);
        with.fixed_view_mut::<6, 6>(0, 4).copy_from(&registered.covariance.matrix);
        let held = |held| CorrelatedCovariance { independent: Vector4::zeros(), held };
        let mut after = held(registered.covariance.matrix);
        let fraction = registered.partners as f64 / key.len().min(ground.len()).max(1) as f64;
        let renewed = fraction < self.settings.keyframe_fraction;
        if renewed {
            // The next step starts at a new key frame and cancels no error.
            with = CorrelatedSensitivities::zeros();
            after = held(Matrix6::zeros());
        }
        let local = RelativeMotion {
            motion,
            covariance: Covariance6::new(registered.covariance.matrix + across * before * across.transpose()),
            correlated: Some(CorrelatedError {
                by,
                keep: SVector::<f64, CORRELATED>::zeros(),
                with,
                before: held(before),
                after,
            }),
        };
        let waypoint = Waypoint { stamp_ns, world_from_camera, local: Some(local) };
        self.segments.last_mut().expect("a segment was begun").poses.push(waypoint);
        let motion = Some((motion, seconds));
        self.last = Some(if renewed {
            let covariance = Covariance6::isotropic(0.0, 0.0);
            Last { stamp_ns, key_from_camera: Transform::identity(), covariance, motion }
        } else {
            Last { stamp_ns, key_from_camera: registered.key_from_now, covariance: registered.covariance, motion }
        });
        if renewed {
            self.key = Some((ground, world_from_camera));
        }
    }
}

/// The motion from the last cloud to a new one, by registration to the key frame.
fn registered(settings: &Icp, key: &Ground, last: &Last, ground: &Ground, stamp_ns: u64) -> Result<Step, Lost> {
    let seconds = (stamp_ns - last.stamp_ns) as f64 * 1e-9;
    if seconds > settings.max_gap {
        return Err(Lost::Gap { seconds, max: settings.max_gap });
    }
    let (found, needed) = (ground.len(), settings.min_points);
    if found < needed {
        return Err(Lost::FewPoints { found, needed });
    }
    let step = last
        .motion
        .map_or_else(Transform::identity, |(motion, before)| Transform::exp(&(motion.log() * (seconds / before))));
    let registered = key.register(settings, ground, &(last.key_from_camera * step))?;
    if !(registered.covariance.position_rms() <= settings.max_sigma) {
        return Err(Lost::Weak(registered.covariance.position_rms()));
    }
    let motion = last.key_from_camera.inverse() * registered.key_from_now;
    let speed = motion.translation().norm() / seconds;
    if speed > settings.max_speed {
        return Err(Lost::Jump { speed, seconds, max: settings.max_speed });
    }
    Ok(Step { registered, motion, seconds })
}
