//! A navigation session: fixes, and odometry between them.

use std::cell::OnceCell;

use rand::Rng;
use seafix_geometry::{Body, Camera, Covariance6, Object, StereoRig, Transform};
use seafix_navigation::{
    ConsiderStates, Event, Navigated, Navigator, ObjectPlacement, ObjectPose, OdometryOutcome as Followed, PoseGraph,
    RelativeMotion, State,
};
use seafix_referencing::{Outcome, Prior, PriorBound, Target};

use crate::{
    Error, FrameData, FrameResult, NavigationStack, PipelineStages, SensorFrame,
    event::NavigationEvent,
    images::check_sizes,
    keyframe_mapper::KeyframeMapper,
    odometry_session::{OdometryResult, TrialOdometry, stereo_pair},
    random,
    stages::{Cloud, View},
};

/// How the reason ends why no motion is known to a pair that the odometry goes on from. A pair that it left out has another
/// reason; of that, the way goes on over it.
pub const UNKNOWN_MOTION: &str = "the way here is unknown";

/// Changes the motion that the odometry found, given the time since the first frame (s).
pub type MotionFilter<'a> = Box<dyn FnMut(f64, Option<RelativeMotion>) -> Option<RelativeMotion> + Send + 'a>;

/// Navigation from fix to fix through successive frames.
///
/// It holds the navigated pose relative to the object of the last fix. For each frame the odometry moves that pose, the
/// policy decides whether a fix is due, and the fusion joins the fix to the pose.
pub struct NavigationSession<'a> {
    navigation_stack: &'a NavigationStack,
    stages: &'a PipelineStages,
    targets: &'a [Target],
    rig: &'a StereoRig,
    navigator: Navigator<'a>,
    keyframe_mapper: Option<KeyframeMapper<'a>>,
    /// Changes the motions of the odometry, for a study of its failures.
    filter: Option<MotionFilter<'a>>,
    body_from_camera: Transform<Body, Camera>,
    /// The odometry of [`push`](Self::push), from its first frame on.
    odometry: Option<TrialOdometry<'a>>,
    frames: u64,
    /// When the first frame was taken (ns).
    began: Option<u64>,
    /// Changes of the navigator's state that have been told.
    reported: usize,
    /// The pair that the odometry knew last: when, and in which segment.
    last: Option<(u64, usize)>,
    /// Whether there has been a fix.
    fixed: bool,
    /// The first fix, carried along by odometry alone, until the way is lost.
    odometry_only: Option<Navigated>,
}

/// The state of a navigation session after a frame.
#[derive(Debug, Clone)]
pub struct NavigationState {
    /// What the pose rests on: the prior, a fix, or dead reckoning since a fix.
    pub state: State,
    /// Whether a fix was attempted.
    pub due: bool,
    /// The navigated pose, relative to the object of the last fix; `None` while there is none.
    pub pose: Option<Navigated>,
    /// The first fix, moved here by odometry alone; `None` before it and after a gap in the odometry.
    pub odometry_only: Option<Navigated>,
    /// The motion of the odometry to this frame.
    pub odometry: Motion,
    /// What happened, in order.
    pub events: Vec<NavigationEvent>,
    /// Duration of the odometry (ms).
    pub odometry_ms: f64,
}

/// The motion of the odometry to a frame.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Why no motion to the frame is known; empty where one is, and at the first frame. It ends in
    /// [`UNKNOWN_MOTION`] where the trajectory is broken and begins again at this frame. Otherwise the frame was
    /// skipped, and the next motion spans it.
    pub lost: String,
    /// The motion from the last known frame, `earlier_from_later`.
    pub step: Option<RelativeMotion>,
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
    /// Sets out, in the network of an earlier run where there is one; every target stands somewhere in the world.
    pub fn begin(
        navigation_stack: &'a NavigationStack,
        stages: &'a PipelineStages,
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
            stages,
            targets,
            rig,
            navigator,
            keyframe_mapper: navigation_stack
                .pose_graph
                .as_ref()
                .map(|keyframes| KeyframeMapper::begin(keyframes, targets, rig, earlier)),
            filter: None,
            body_from_camera,
            odometry: None,
            frames: 0,
            began: None,
            reported: 0,
            last: None,
            fixed: false,
            odometry_only: None,
        }
    }

    /// The same with `filter` between the odometry and the navigator.
    #[must_use]
    pub fn with_motion_filter(self, filter: MotionFilter<'a>) -> Self {
        Self { filter: Some(filter), ..self }
    }

    /// The targets; a [`Navigated`] pose names its object by the index here.
    pub fn targets(&self) -> &'a [Target] {
        self.targets
    }

    /// Takes the next frame: moves the pose by odometry and takes a fix where one is due.
    ///
    /// Frames come in order of time and must be stereo pairs of the session's rig.
    ///
    /// # Errors
    /// [`Error::Frame`]: a frame without images, or one that is not later than the frame before.
    pub fn push(&mut self, frame: &SensorFrame) -> Result<NavigationState, Error> {
        let invalid = |cause: String| Error::Frame { stamp_ns: frame.stamp_ns, cause };
        if let FrameData::Stereo(left, right) = &frame.frame_data {
            check_sizes(left, right, self.rig)?;
        }
        let (navigation_stack, rig, mounting) = (self.navigation_stack, self.rig, self.body_from_camera);
        let odometry = self.odometry.get_or_insert_with(|| navigation_stack.begin_odometry(rig, mounting));
        let moved = odometry.advance(frame).map_err(invalid)?;
        let mut rng = random::of_frame(0, self.frames);
        self.frames += 1;
        let cloud = OnceCell::new();
        let make = || cloud.get_or_init(|| self.stages.cloud(&frame.frame_data, rig));
        self.advance(frame, &moved, make, &mut rng).map(|(_, state)| state).map_err(invalid)
    }

    /// The same for a caller that computes odometry and cloud itself. The last fix is carried along by the `moved` odometry, and another is taken from the `cloud` where
    /// one is due.
    ///
    /// # Errors
    /// A sentence: the frame is no stereo pair.
    pub fn advance<'b>(
        &mut self,
        sensor_frame: &'b SensorFrame,
        moved: &OdometryResult,
        cloud: impl FnOnce() -> &'b Cloud,
        rng: &mut dyn Rng,
    ) -> Result<(FrameResult, NavigationState), String> {
        let pair = stereo_pair(sensor_frame)?;
        let mut events = Vec::new();
        let odometry = self.carry(sensor_frame, moved, &mut events);

        // Where the odometry is not, neither is the navigator: a fix would have no place in the order of motions.
        let here = self.last.is_some_and(|(stamp_ns, _)| stamp_ns == sensor_frame.stamp_ns);
        let prior_pose = sensor_frame.prior_pose(self.targets);
        let priors = self.priors(&prior_pose);
        let in_view =
            || self.targets.iter().zip(&priors).any(|(target, prior)| PipelineStages::shows(target, prior, self.rig));
        let due = match here {
            true => self.navigator.due(in_view()),
            false => {
                let ago = self.last.map_or(0.0, |(stamp_ns, _)| (sensor_frame.stamp_ns - stamp_ns) as f64 * 1e-9);
                self.navigator.blind(ago, in_view())
            }
        };
        let frame_result = match here && due {
            true => self.search_targets(sensor_frame, cloud(), &priors, &prior_pose, rng),
            false => FrameResult::default(),
        };
        let taken = self.fix(&frame_result, &mut events);
        if here && let Some(keyframe_mapper) = &mut self.keyframe_mapper {
            keyframe_mapper.visit(sensor_frame, &pair, &mut self.navigator, &taken, &mut events);
        }
        self.report_changes(&mut events);
        let pose = self.navigator.pose().filter(|_| here).cloned();
        let odometry_only = self.odometry_only.clone().filter(|_| here);
        let state = self.navigator.state();
        Ok((frame_result, NavigationState { state, due, pose, odometry_only, odometry, events, odometry_ms: moved.ms }))
    }

    /// Carries the pose to this frame where the odometry knows the way.
    fn carry(
        &mut self,
        sensor_frame: &SensorFrame,
        moved: &OdometryResult,
        events: &mut Vec<NavigationEvent>,
    ) -> Motion {
        let began = *self.began.get_or_insert(sensor_frame.stamp_ns);
        let now = moved.latest.filter(|(_, waypoint)| waypoint.stamp_ns == sensor_frame.stamp_ns);
        let (Some((segment, waypoint)), false) = (now, matches!(moved.followed, Followed::Skipped(_))) else {
            let lost = match &moved.followed {
                Followed::Skipped(lost) => lost.to_string(),
                Followed::Began | Followed::Followed { .. } => String::new(),
            };
            events.push(NavigationEvent::NoMotion { why: lost.clone() });
            return Motion { lost, step: None };
        };
        let before = self.last.replace((sensor_frame.stamp_ns, segment));
        let Some((stamp_ns, left)) = before else { return Motion::default() };
        let seconds = (sensor_frame.stamp_ns - stamp_ns) as f64 * 1e-9;
        let found = waypoint.local.filter(|_| left == segment);
        let time = (sensor_frame.stamp_ns - began) as f64 * 1e-9;
        let motion = match &mut self.filter {
            Some(filter) => filter(time, found),
            None => found,
        };
        self.navigator.advance(seconds, motion.as_ref());
        self.keyframe_mapper.iter_mut().for_each(|keyframe_mapper| keyframe_mapper.advance(seconds, motion.as_ref()));
        self.odometry_only = self.odometry_only.take().zip(motion).map(|(pose, motion)| pose.after(&motion));
        let Some(motion) = motion else {
            let why = if found.is_some() { "it failed" } else { "a new segment begins" };
            return Motion { lost: format!("{why}: {UNKNOWN_MOTION}"), step: None };
        };
        Motion { lost: String::new(), step: Some(motion) }
    }

    /// What is known before a fix: the navigated pose, passed to each object; else the rough one.
    fn priors(&self, prior_pose: &[Option<Prior>]) -> Vec<Option<Prior>> {
        let known = |index| {
            let ObjectPose { object_from_camera, covariance, .. } = self.navigator.pose_at(index)?.object_pose;
            Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) })
        };
        prior_pose.iter().enumerate().map(|(index, prior_pose)| known(index).or_else(|| prior_pose.clone())).collect()
    }

    /// Attempts every object in view where it is believed to be. What stands elsewhere than surveyed is not found there:
    /// the rough pose then says where to look once more.
    fn search_targets(
        &self,
        sensor_frame: &SensorFrame,
        cloud: &Cloud,
        priors: &[Option<Prior>],
        prior_pose: &[Option<Prior>],
        rng: &mut dyn Rng,
    ) -> FrameResult {
        let view = View { sensor_frame, cloud, targets: self.targets, rig: self.rig };
        let mut frame_result = self.stages.fix_from(view, priors, None, rng);
        if self.navigator.pose().is_some() {
            self.stages.again(&mut frame_result, view, prior_pose, rng);
        }
        frame_result
    }

    /// Gives the fixes to the navigator; those that it took.
    fn fix(&mut self, frame_result: &FrameResult, events: &mut Vec<NavigationEvent>) -> Vec<Navigated> {
        let mut taken = Vec::new();
        for attempt in &frame_result.attempts {
            let Outcome::Fix(fix) = &attempt.answer.outcome else { continue };
            let target = &self.targets[attempt.target];
            let object = target.name.clone();
            let sensitivities = match self.stages.model_errors(fix, target, &frame_result.cloud, self.rig) {
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
            // What is laid by an object that may have been moved would stand where it does not.
            let sure = !self.navigator.is_disputed(attempt.target);
            if sure && matches!(event, Event::Taken | Event::Left | Event::Relocated) {
                taken.push(fix.clone());
            }
            match event {
                Event::Taken => events.push(NavigationEvent::FixTaken { object }),
                Event::Left => events.push(NavigationEvent::FixLeft { object }),
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
        taken
    }

    /// What its network has become, as a file, where it is to be kept.
    pub fn pose_graph(self) -> Option<String> {
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

/// Where the objects stand by the survey.
pub fn places(targets: &[Target]) -> Vec<ObjectPlacement> {
    let place = |target: &Target| ObjectPlacement {
        world_from_object: target.world_from_object.expect("checked when the source was opened"),
        covariance: target.survey.unwrap_or_else(|| Covariance6::<_, Object>::new(nalgebra::Matrix6::zeros())),
    };
    targets.iter().map(place).collect()
}
