//! Navigation from fix to fix, with odometry in between.

use std::cell::OnceCell;

use rand::Rng;
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_navigation::{
    ConsiderStates, Event, Navigated, Navigator, ObjectPose, OdometryOutcome, PoseGraph, RangeOffset, RelativeMotion,
    State,
};
use seafix_referencing::{Outcome, Prior, PriorBound, Target};
use seafix_vision::Regions;

use crate::places::places;
use crate::{
    error::Error,
    event::NavigationEvent,
    frame_result::{Cloud, FrameResult, View},
    images::check_sizes,
    keyframe_mapper::KeyframeMapper,
    navigation_stack::NavigationStack,
    odometry_session::{FrameOdometry, OdometryResult, stereo_pair},
    pipeline::Pipeline,
    random,
    sensor_frame::{FrameData, SensorFrame},
};

/// A function that replaces the motion of the odometry. It is called with the time since the first frame (s) and the
/// measured motion, and returns the motion to use; `None` is a break.
pub type MotionOverride<'a> = Box<dyn FnMut(f64, Option<RelativeMotion>) -> Option<RelativeMotion> + Send + 'a>;

/// Navigation of a vehicle through successive frames, from fix to fix.
///
/// The session holds the pose of the camera relative to the object of the last fix. The odometry moves that pose to
/// each frame, the policy decides whether a fix is due, and the fusion combines the fix with the pose.
///
/// ```
/// use seafix::geometry::Transform;
/// use seafix::{Hints, Localizer, Navigation, PosePrior, Rig, SensorFrame, Site, StereoImages};
///
/// # fn main() -> Result<(), seafix::Error> {
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
/// # let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
/// # let attitude = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(-0.31943, -0.10266, -0.03577, 0.94135));
/// # let world_from_camera = Transform::new(attitude, nalgebra::Vector3::new(-23.459, -5.727, 36.558));
/// # let images = StereoImages::open(format!("{folder}/left000.png"), format!("{folder}/right000.png"), &rig)?;
/// let localizer = Localizer::new(&site, &rig)?;
/// let navigation_stack = Navigation::default().build()?;
/// let mut session = localizer.navigate(&navigation_stack, None)?;
/// let state = session.push(&SensorFrame {
///     stamp_ns: 1_700_000_000_000_000_000,
///     frame_data: images.into_frame_data(),
///     prior: Some(PosePrior::isotropic(world_from_camera, 0.5_f64.to_radians(), 0.1)),
///     hints: Hints::Nothing,
///     readings: Vec::new(),
/// })?;
/// println!("{}", state.state);
/// state.events.iter().for_each(|event| println!("{event}"));
/// assert!(state.due, "the default policy asks for a fix at every frame");
/// # Ok(())
/// # }
/// ```
pub struct NavigationSession<'a> {
    navigation_stack: &'a NavigationStack,
    pipeline: &'a Pipeline,
    targets: &'a [Target],
    rig: &'a StereoRig,
    navigator: Navigator<'a>,
    keyframe_mapper: Option<KeyframeMapper<'a>>,
    /// Replaces the odometry's motions, for the study of its failures.
    motion_override: Option<MotionOverride<'a>>,
    body_from_camera: Transform<Body, Camera>,
    /// The odometry of [`push`](Self::push); `None` before the first frame.
    odometry: Option<FrameOdometry<'a>>,
    frames: u64,
    seed: u64,
    latest: FrameResult,
    /// The time of the first frame (ns).
    began: Option<u64>,
    /// The number of reported changes of the navigator's state.
    reported: usize,
    /// The last frame that the odometry accepted: its time (ns) and its segment.
    last: Option<(u64, usize)>,
    /// Whether there has been a fix.
    fixed: bool,
    /// The first fix moved by odometry alone; `None` from the first gap of the odometry on.
    odometry_only: Option<Navigated>,
}

/// The state of a navigation session after a frame.
#[derive(Debug, Clone)]
pub struct NavigationState {
    /// The basis of the pose: the prior, a search for a due fix, a fix, or dead reckoning since a fix.
    pub state: State,
    /// Whether a fix was due.
    pub due: bool,
    /// The pose relative to the object of the last fix or, after a recognised key frame, to the most accurate object of the pose
    /// graph.
    ///
    /// `None` at a skipped frame, before the first fix, and after a break until a fix or a recognised key frame.
    pub pose: Option<Navigated>,
    /// The first fix moved to this frame by odometry alone; `None` before it, at a skipped frame, and after a break.
    pub odometry_only: Option<Navigated>,
    /// The motion of the odometry to this frame.
    pub odometry: Motion,
    /// The events of this frame, in order.
    pub events: Vec<NavigationEvent>,
    /// Duration of the odometry (ms).
    pub odometry_ms: f64,
}

/// The motion of the odometry to a frame.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "one a frame, nearly always a known motion")]
pub enum Motion {
    /// No motion: this is the first frame that the odometry accepted.
    First,
    /// The motion since the last accepted frame, `earlier_from_later`.
    Known(RelativeMotion),
    /// The odometry skipped the frame for this reason. The next motion spans it, unless a segment ends here.
    Skipped(String),
    /// The motion is unknown for this reason. A new segment of the trajectory begins, at this frame or at a skipped one
    /// before it.
    Unknown(String),
}

impl std::fmt::Debug for NavigationSession<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NavigationSession")
            .field("frames", &self.frames)
            .field("last", &self.last)
            .finish_non_exhaustive()
    }
}

impl<'a> NavigationSession<'a> {
    /// Begins a session, with the pose graph of an `earlier` run if there is one. Every target needs a pose in the
    /// world.
    pub fn begin(
        navigation_stack: &'a NavigationStack,
        pipeline: &'a Pipeline,
        targets: &'a [Target],
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
        earlier: Option<&PoseGraph>,
    ) -> Self {
        let names = targets.iter().map(|target| target.name.clone()).collect();
        let navigator =
            Navigator::new(places(targets), &*navigation_stack.policy, &*navigation_stack.fusion).with_names(names);
        Self {
            navigation_stack,
            pipeline,
            targets,
            rig,
            navigator,
            keyframe_mapper: navigation_stack
                .pose_graph
                .as_ref()
                .map(|keyframes| KeyframeMapper::begin(keyframes, targets, rig, earlier)),
            motion_override: None,
            body_from_camera,
            odometry: None,
            frames: 0,
            seed: 0,
            latest: FrameResult::default(),
            began: None,
            reported: 0,
            last: None,
            fixed: false,
            odometry_only: None,
        }
    }

    /// Sets the seed of searches that draw random numbers; the default is 0.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets a function between the odometry and the navigator.
    #[must_use]
    pub fn with_motion_override(self, motion_override: MotionOverride<'a>) -> Self {
        Self { motion_override: Some(motion_override), ..self }
    }

    /// The targets; the field `object` of a [`Navigated`] pose is an index into them.
    pub fn targets(&self) -> &'a [Target] {
        self.targets
    }

    /// Processes the next frame: moves the pose by odometry and takes a fix if one is due. At a frame that the odometry
    /// skipped, no fix is attempted. Objects are searched at the navigated pose, those without a fix there again at the
    /// frame's own prior; [`last_result`](Self::last_result) has the attempts.
    ///
    /// Frames are stereo pairs of the session's rig, in order of time.
    ///
    /// # Errors
    /// [`Error::ImageSize`]: an image of another size than its camera is calibrated for. [`Error::Frame`]: a frame
    /// without images, or one that is not later than the previous frame.
    pub fn push(&mut self, frame: &SensorFrame) -> Result<NavigationState, Error> {
        let invalid = |cause: String| Error::Frame { stamp_ns: frame.stamp_ns, cause };
        if let FrameData::Stereo(left, right) = &frame.frame_data {
            check_sizes(left, right, self.rig)?;
        }
        let (navigation_stack, rig, mounting) = (self.navigation_stack, self.rig, self.body_from_camera);
        let odometry = self.odometry.get_or_insert_with(|| navigation_stack.begin_odometry(rig, mounting));
        let moved = odometry.advance(frame).map_err(invalid)?;
        let mut rng = random::of_frame(self.seed, self.frames);
        self.frames += 1;
        let cloud = OnceCell::new();
        let make = |regions: &[Regions; 2]| {
            cloud.get_or_init(|| self.pipeline.cloud(&frame.frame_data, rig, self.targets, regions))
        };
        let (result, state) = self.advance(frame, &moved, make, &mut rng).map_err(invalid)?;
        self.latest = result;
        Ok(state)
    }

    /// The constant error of the rig's disparities (px), estimated from motion; `None` until it is determined.
    ///
    /// The odometry corrects it in its own rig, unless its setting `correct-range-offset` is false. Fixes use the rig as
    /// given: build the localizer with [`StereoRig::with_range_offset`] to correct them too.
    pub fn range_offset(&self) -> Option<RangeOffset> {
        self.odometry.as_ref()?.range_offset()
    }

    /// The attempts of the last frame given to [`push`](Self::push), rejected ones with their reasons; empty if none was
    /// due, or if the odometry skipped the frame.
    pub fn last_result(&self) -> &FrameResult {
        &self.latest
    }

    /// Processes the next frame with odometry and cloud that the caller computed.
    ///
    /// The odometry result `moved` moves the pose. The closure `cloud` is called only if a fix is due, with the regions
    /// of both images where the targets are expected.
    ///
    /// # Errors
    /// The cause as a sentence: the frame is no stereo pair.
    pub fn advance<'b>(
        &mut self,
        sensor_frame: &'b SensorFrame,
        moved: &OdometryResult,
        cloud: impl FnOnce(&[Regions; 2]) -> &'b Cloud,
        rng: &mut dyn Rng,
    ) -> Result<(FrameResult, NavigationState), String> {
        let pair = stereo_pair(sensor_frame)?;
        let mut events = Vec::new();
        let odometry = self.move_pose(sensor_frame, moved, &mut events);

        // A fix at a frame that the odometry skipped would have no place in the sequence of motions: none is attempted.
        let accepted = self.last.is_some_and(|(stamp_ns, _)| stamp_ns == sensor_frame.stamp_ns);
        let prior_pose = sensor_frame.target_priors(self.targets);
        let priors = self.priors(&prior_pose);
        let in_view =
            || self.targets.iter().zip(&priors).any(|(target, prior)| self.pipeline.shows(target, prior, self.rig));
        let due = match accepted {
            true => self.navigator.due(in_view()),
            false => {
                let ago = self.last.map_or(0.0, |(stamp_ns, _)| (sensor_frame.stamp_ns - stamp_ns) as f64 * 1e-9);
                self.navigator.due_without_motion(ago, in_view())
            }
        };
        let frame_result = match accepted && due {
            true => {
                let regions = self.pipeline.regions(self.targets, &[&priors, &prior_pose], self.rig);
                self.search_targets(sensor_frame, cloud(&regions), &priors, &prior_pose, rng)
            }
            false => FrameResult::default(),
        };
        let placing = self.fix(&frame_result, &mut events);
        if accepted && let Some(keyframe_mapper) = &mut self.keyframe_mapper {
            keyframe_mapper.visit(sensor_frame, &pair, &mut self.navigator, &placing, &mut events);
        }
        self.report_changes(&mut events);
        let pose = self.navigator.pose().filter(|_| accepted).cloned();
        let odometry_only = self.odometry_only.clone().filter(|_| accepted);
        let state = self.navigator.state();
        Ok((frame_result, NavigationState { state, due, pose, odometry_only, odometry, events, odometry_ms: moved.ms }))
    }

    /// Moves the pose to this frame if the motion is known.
    fn move_pose(
        &mut self,
        sensor_frame: &SensorFrame,
        moved: &OdometryResult,
        events: &mut Vec<NavigationEvent>,
    ) -> Motion {
        let began = *self.began.get_or_insert(sensor_frame.stamp_ns);
        let now = moved.latest.filter(|(_, waypoint)| waypoint.stamp_ns == sensor_frame.stamp_ns);
        let (Some((segment, waypoint)), false) = (now, matches!(moved.outcome, OdometryOutcome::Skipped(_))) else {
            let why = match &moved.outcome {
                OdometryOutcome::Skipped(why) => why.to_string(),
                OdometryOutcome::Began | OdometryOutcome::Followed { .. } => String::new(),
            };
            events.push(NavigationEvent::NoMotion { why: why.clone() });
            return Motion::Skipped(why);
        };
        let before = self.last.replace((sensor_frame.stamp_ns, segment));
        let Some((earlier_ns, earlier_segment)) = before else { return Motion::First };
        let seconds = (sensor_frame.stamp_ns - earlier_ns) as f64 * 1e-9;
        let measured = waypoint.local.filter(|_| earlier_segment == segment);
        let time = (sensor_frame.stamp_ns - began) as f64 * 1e-9;
        let motion = match &mut self.motion_override {
            Some(replace) => replace(time, measured),
            None => measured,
        };
        self.navigator.advance(seconds, motion.as_ref());
        self.keyframe_mapper.iter_mut().for_each(|keyframe_mapper| keyframe_mapper.advance(seconds, motion.as_ref()));
        self.odometry_only = self.odometry_only.take().zip(motion).map(|(pose, motion)| pose.after(&motion));
        match motion {
            Some(motion) => Motion::Known(motion),
            None if measured.is_some() => Motion::Unknown("the odometry failed".to_owned()),
            None => Motion::Unknown("a new segment begins".to_owned()),
        }
    }

    /// The prior of each object: the navigated pose passed to it, otherwise the prior pose of the frame.
    fn priors(&self, prior_pose: &[Option<Prior>]) -> Vec<Option<Prior>> {
        let known = |index| {
            let ObjectPose { object_from_camera, covariance, .. } = self.navigator.pose_at(index)?.object_pose;
            Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) })
        };
        prior_pose.iter().enumerate().map(|(index, prior_pose)| known(index).or_else(|| prior_pose.clone())).collect()
    }

    /// Searches every object in view at its predicted pose. An object that was moved since the survey is not found
    /// there, so that the search is repeated with the frame's prior pose.
    fn search_targets(
        &self,
        sensor_frame: &SensorFrame,
        cloud: &Cloud,
        priors: &[Option<Prior>],
        prior_pose: &[Option<Prior>],
        rng: &mut dyn Rng,
    ) -> FrameResult {
        let view = View { sensor_frame, cloud, targets: self.targets, rig: self.rig };
        let mut frame_result = self.pipeline.fix_from(view, priors, None, rng);
        if self.navigator.pose().is_some() {
            self.pipeline.retry_without_fix(&mut frame_result, view, prior_pose, rng);
        }
        frame_result
    }

    /// Gives the fixes to the navigator. Returns those that may place a key frame.
    fn fix(&mut self, frame_result: &FrameResult, events: &mut Vec<NavigationEvent>) -> Vec<Navigated> {
        let mut placing = Vec::new();
        for attempt in &frame_result.attempts {
            let Outcome::Fix(fix) = &attempt.answer.outcome else { continue };
            let target = &self.targets[attempt.target];
            let object = target.name.clone();
            let sensitivities = match self.pipeline.model_sensitivities(
                fix,
                target,
                (&frame_result.cloud, &frame_result.lines),
                self.rig,
            ) {
                Ok(sensitivities) => sensitivities,
                Err(why) => {
                    events.push(NavigationEvent::FixUnused { object, why: why.to_string() });
                    continue;
                }
            };
            let object_pose = ObjectPose::new(fix.object_from_camera, fix.covariance)
                .with_consider_states(ConsiderStates::of_model(attempt.target, sensitivities));
            let fix = Navigated { object: attempt.target, object_pose };
            let event = self.navigator.fix(&fix);
            // A key frame added at an object that may have been moved would be placed wrongly.
            let sure = !self.navigator.is_disputed(attempt.target);
            if sure && matches!(event, Event::Taken | Event::LessAccurate | Event::Relocated) {
                placing.push(fix.clone());
            }
            match event {
                Event::Taken => events.push(NavigationEvent::FixTaken { object }),
                Event::LessAccurate => events.push(NavigationEvent::FixLessAccurate { object }),
                Event::Doubted(why) => events.push(NavigationEvent::FixDoubted { object, why: why.to_string() }),
                Event::Relocated => events.push(NavigationEvent::FixesOverrule { object }),
                Event::Disputed { objects, metres } => {
                    let objects = objects.map(|object| self.targets[object].name.clone());
                    events.push(NavigationEvent::Disputed { objects, metres });
                }
                Event::Displaced(found) => {
                    let object = self.targets[found.object].name.clone();
                    let metres = found.old_from_new.translation().norm();
                    events.push(NavigationEvent::Displaced { object, metres });
                    self.keyframe_mapper.iter_mut().for_each(|keyframe_mapper| keyframe_mapper.displaced(&found));
                }
            }
            if !std::mem::replace(&mut self.fixed, true) {
                self.odometry_only = Some(fix);
            }
        }
        placing
    }

    /// The pose graph in its file format; `None` unless the settings ask for it.
    pub fn into_pose_graph_text(self) -> Option<String> {
        self.keyframe_mapper?.finish()
    }

    fn report_changes(&mut self, events: &mut Vec<NavigationEvent>) {
        let changes = self.navigator.changes();
        let new = &changes[self.reported..];
        events.extend(new.iter().map(|change| NavigationEvent::State {
            from: change.from.to_string(),
            to: change.to.to_string(),
            why: change.why.to_string(),
        }));
        self.reported = changes.len();
    }
}
