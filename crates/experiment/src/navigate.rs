//! Between fixes: odometry, when to take the next fix, and what becomes of the pose then.

use rand::Rng;
use seafix_component::Choice;
use seafix_geometry::{Covariance6, Object, StereoRig};
use seafix_log::{ELSEWHERE, NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep};
use seafix_navigation::{
    Considered, Event, FUSIONS, Fusion, Navigated, Navigator, Network, ODOMETRIES, Odometry, Outcome as Followed,
    POLICIES, Place, Policy, Standing,
};
use seafix_referencing::{Outcome, Prior, PriorBound, Target};
use serde::{Deserialize, Serialize};

use crate::{
    Keyframes, PipelineError, Sighting, Stages,
    explore::Explorer,
    odometry_fault::{Motions, OdometryFault},
    odometry_session::{OdometryResult, OdometrySession, stereo_pair},
    pipeline::{build, faults, misfit, resolve},
    record::rows6,
    source::{Passage, Sight},
    stages::{Cloud, View},
};

/// How the reason ends why no motion is known to a pair that the odometry goes on from. A pair that it left out has another
/// reason; of that, the way goes on over it.
pub(crate) const THE_WAY_IS_UNKNOWN: &str = "the way here is unknown";

/// The settings of the way from fix to fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Navigation {
    /// Carries the last fix along.
    pub odometry: Choice,
    /// When a fix is tried.
    pub policy: Choice,
    /// What becomes of the navigated pose when a fix comes.
    pub fusion: Choice,
    /// How the odometry fails, and when.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<OdometryFault>,
    /// Key frames where no object is in view; without it none are laid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<Keyframes>,
}

impl Default for Navigation {
    fn default() -> Self {
        Self {
            odometry: Choice::named("stereo"),
            policy: Choice::named("every-frame"),
            fusion: Choice::named("fuse"),
            faults: Vec::new(),
            network: None,
        }
    }
}

impl Navigation {
    /// The same with every setting of its components written out.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self {
            odometry: resolve(&ODOMETRIES, &self.odometry)?,
            policy: resolve(&POLICIES, &self.policy)?,
            fusion: resolve(&FUSIONS, &self.fusion)?,
            faults: self.faults.clone(),
            network: self.network.as_ref().map(Keyframes::resolved).transpose()?,
        })
    }

    /// Every setting that it cannot be built with.
    pub(crate) fn unfit(&self) -> Vec<PipelineError> {
        let mut all = faults(&ODOMETRIES, &self.odometry);
        all.extend(faults(&POLICIES, &self.policy));
        all.extend(faults(&FUSIONS, &self.fusion));
        all.extend(self.unsound());
        all.extend(self.network.iter().flat_map(Keyframes::unfit));
        all
    }

    /// The faults that are none.
    fn unsound(&self) -> impl Iterator<Item = PipelineError> {
        let all = self.faults.iter().enumerate().filter_map(|(k, fault)| fault.check(k).err());
        all.map(|message| misfit("faults", message))
    }

    /// Ready to work.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn build(&self) -> Result<Helm, PipelineError> {
        let unfit = self.unsound().chain(self.network.iter().flat_map(Keyframes::unfit)).next();
        unfit.map_or(Ok(()), Err)?;
        Ok(Helm {
            odometry: build(&ODOMETRIES, &self.odometry)?,
            policy: build(&POLICIES, &self.policy)?,
            fusion: build(&FUSIONS, &self.fusion)?,
            faults: self.faults.clone(),
            network: self.network.clone(),
        })
    }
}

/// The components between fixes, built.
#[derive(Debug)]
pub struct Helm {
    odometry: Box<dyn Odometry>,
    policy: Box<dyn Policy>,
    fusion: Box<dyn Fusion>,
    faults: Vec<OdometryFault>,
    pub(crate) network: Option<Keyframes>,
}

impl Helm {
    /// Whether it cannot do without what the vehicle's Doppler log and gyro say.
    pub(crate) fn listens(&self) -> bool {
        self.odometry.listens()
    }

    /// Its odometry, with nothing seen yet.
    pub(crate) fn begin_odometry<'a>(&'a self, passage: &'a dyn Passage) -> OdometrySession<'a> {
        OdometrySession::begin(&*self.odometry, passage)
    }
}

/// A trial's way through the frames of a passage, in their order.
pub(crate) struct Voyage<'a> {
    stages: &'a Stages,
    targets: &'a [Target],
    rig: &'a StereoRig,
    navigator: Navigator<'a>,
    explorer: Option<Explorer<'a>>,
    /// How the odometry fails, and its motions on their way through that.
    faults: &'a [OdometryFault],
    motions: Motions,
    /// When the first frame was taken (ns).
    began: Option<u64>,
    /// Changes of the navigator's state that have been told.
    told: usize,
    /// The pair that the odometry knew last: when, and in which segment.
    last: Option<(u64, usize)>,
    /// Whether there has been a fix.
    fixed: bool,
    /// The first fix, carried along by odometry alone, until the way is lost.
    unreferenced: Option<Navigated>,
}

/// What a trial that navigates knew after a frame.
pub(crate) struct Underway {
    pub(crate) record: NavigationRecord,
    /// The navigated pose.
    pub(crate) pose: Option<Navigated>,
    /// The first fix carried here by odometry alone.
    pub(crate) unreferenced: Option<Navigated>,
    pub(crate) odometry_ms: f64,
}

impl<'a> Voyage<'a> {
    /// Sets out, in the network of an earlier run where there is one; every target stands somewhere in the world.
    pub(crate) fn begin(
        helm: &'a Helm,
        stages: &'a Stages,
        targets: &'a [Target],
        passage: &'a dyn Passage,
        earlier: Option<&Network>,
    ) -> Self {
        let rig = passage.rig();
        let names = targets.iter().map(|target| target.name.clone()).collect();
        let navigator = Navigator::new(places(targets), &*helm.policy, &*helm.fusion).with_names(names);
        Self {
            stages,
            targets,
            rig,
            navigator,
            explorer: helm.network.as_ref().map(|keyframes| Explorer::begin(keyframes, targets, rig, earlier)),
            faults: &helm.faults,
            motions: Motions::default(),
            began: None,
            told: 0,
            last: None,
            fixed: false,
            unreferenced: None,
        }
    }

    /// The next frame: the last fix is carried along by the `moved` odometry, and another is taken from the `cloud` where
    /// one is due.
    ///
    /// # Errors
    /// A sentence: the frame is no stereo pair.
    pub(crate) fn advance<'b>(
        &mut self,
        sight: &'b Sight,
        moved: &OdometryResult,
        cloud: impl FnOnce() -> &'b Cloud,
        rng: &mut dyn Rng,
    ) -> Result<(Sighting, Underway), String> {
        let pair = stereo_pair(sight)?;
        let mut events = Vec::new();
        let odometry = self.carry(sight, moved, &mut events);

        // Where the odometry is not, neither is the navigator: a fix would have no place in the order of motions.
        let here = self.last.is_some_and(|(stamp_ns, _)| stamp_ns == sight.stamp_ns);
        let rough = sight.rough(self.targets);
        let priors = self.priors(&rough);
        let in_view = || self.targets.iter().zip(&priors).any(|(target, prior)| Stages::shows(target, prior, self.rig));
        let due = match here {
            true => self.navigator.due(in_view()),
            false => {
                let ago = self.last.map_or(0.0, |(stamp_ns, _)| (sight.stamp_ns - stamp_ns) as f64 * 1e-9);
                self.navigator.blind(ago, in_view())
            }
        };
        let sighting = match here && due {
            true => self.look(sight, cloud(), &priors, &rough, rng),
            false => Sighting::default(),
        };
        let taken = self.fix(&sighting, &mut events);
        if here && let Some(explorer) = &mut self.explorer {
            explorer.visit(sight, &pair, &mut self.navigator, &taken, &mut events);
        }
        self.tell(&mut events);
        let pose = self.navigator.pose().filter(|_| here).cloned();
        let unreferenced = self.unreferenced.clone().filter(|_| here);
        let record = NavigationRecord {
            state: self.navigator.state().to_string(),
            due,
            pose: pose.as_ref().map(|pose| self.record(pose)),
            unreferenced: unreferenced.as_ref().map(|pose| self.record(pose)),
            odometry,
            events,
            errors: NavigationErrors::default(),
        };
        Ok((sighting, Underway { record, pose, unreferenced, odometry_ms: moved.ms }))
    }

    /// Carries the pose to this frame where the odometry knows the way.
    fn carry(&mut self, sight: &Sight, moved: &OdometryResult, events: &mut Vec<String>) -> OdometryStep {
        let began = *self.began.get_or_insert(sight.stamp_ns);
        let now = moved.latest.filter(|(_, waypoint)| waypoint.stamp_ns == sight.stamp_ns);
        let (Some((segment, waypoint)), false) = (now, matches!(moved.followed, Followed::Skipped(_))) else {
            let lost = match &moved.followed {
                Followed::Skipped(lost) => lost.to_string(),
                Followed::Began | Followed::Followed { .. } => String::new(),
            };
            events.push(format!("no motion to this pair: {lost}"));
            return OdometryStep { lost, motion: None };
        };
        let before = self.last.replace((sight.stamp_ns, segment));
        let Some((stamp_ns, left)) = before else { return OdometryStep::default() };
        let seconds = (sight.stamp_ns - stamp_ns) as f64 * 1e-9;
        let found = waypoint.local.filter(|_| left == segment);
        let time = (sight.stamp_ns - began) as f64 * 1e-9;
        let motion = self.motions.passed(self.faults, time, found);
        self.navigator.advance(seconds, motion.as_ref());
        self.explorer.iter_mut().for_each(|explorer| explorer.advance(seconds, motion.as_ref()));
        self.unreferenced = self.unreferenced.take().zip(motion).map(|(pose, motion)| pose.after(&motion));
        let Some(motion) = motion else {
            let why = if found.is_some() { "it failed" } else { "a new segment begins" };
            return OdometryStep { lost: format!("{why}: {THE_WAY_IS_UNKNOWN}"), motion: None };
        };
        OdometryStep { lost: String::new(), motion: Some((motion.motion.rows(), rows6(&motion.covariance.matrix))) }
    }

    /// What is known before a fix: the navigated pose, passed to each object; else the rough one.
    fn priors(&self, rough: &[Option<Prior>]) -> Vec<Option<Prior>> {
        let known = |index| {
            let Standing { object_from_camera, covariance, .. } = self.navigator.pose_at(index)?.standing;
            Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) })
        };
        rough.iter().enumerate().map(|(index, rough)| known(index).or_else(|| rough.clone())).collect()
    }

    /// Attempts every object in view where it is believed to be. What stands elsewhere than surveyed is not found there:
    /// the rough pose then says where to look once more.
    fn look(
        &self,
        sight: &Sight,
        cloud: &Cloud,
        priors: &[Option<Prior>],
        rough: &[Option<Prior>],
        rng: &mut dyn Rng,
    ) -> Sighting {
        let view = View { sight, cloud, targets: self.targets, rig: self.rig };
        let mut sighting = self.stages.reference_from(view, priors, None, rng);
        if self.navigator.pose().is_some() {
            self.stages.again(&mut sighting, view, rough, rng);
        }
        sighting
    }

    /// Gives the fixes to the navigator; those that it took.
    fn fix(&mut self, sighting: &Sighting, events: &mut Vec<String>) -> Vec<Navigated> {
        let mut taken = Vec::new();
        for attempt in &sighting.attempts {
            let Outcome::Referenced(fix) = &attempt.answer.outcome else { continue };
            let target = &self.targets[attempt.target];
            let name = &target.name;
            let shares = match self.stages.model_errors(fix, target, &sighting.cloud, self.rig) {
                Ok(shares) => shares,
                Err(why) => {
                    events.push(format!("fix at {name} not used, what it owes to the model is unknown: {why}"));
                    continue;
                }
            };
            let standing = Standing::new(fix.object_from_camera, fix.covariance)
                .considering(Considered::of_model(attempt.target, shares));
            let fix = Navigated { object: attempt.target, standing };
            let event = self.navigator.fix(&fix);
            // What is laid by an object that may have been moved would stand where it does not.
            let sure = !self.navigator.is_disputed(attempt.target);
            if sure && matches!(event, Event::Taken | Event::Left | Event::Relocated) {
                taken.push(fix.clone());
            }
            match event {
                Event::Taken => events.push(format!("fix at {name} taken")),
                Event::Left => events.push(format!("fix at {name} left: the last one, carried here, is better known")),
                Event::Doubted(why) => events.push(format!("fix at {name} doubted: {why}")),
                Event::Relocated => events.push(format!("fixes at {name} overrule what was known")),
                Event::Disputed { objects, metres } => {
                    let [one, other] = objects.map(|object| &self.targets[object].name);
                    events.push(format!(
                        "{one} or {other} stands {metres:.3} {ELSEWHERE}, one of the two; a third object will tell which"
                    ));
                }
                Event::Displaced(found) => {
                    let shift = found.old_from_new.translation().norm();
                    events.push(format!("{} stands {shift:.3} {ELSEWHERE}", self.targets[found.object].name));
                    self.explorer.iter_mut().for_each(|explorer| explorer.displaced(&found));
                }
            }
            if !std::mem::replace(&mut self.fixed, true) {
                self.unreferenced = Some(fix);
            }
        }
        taken
    }

    /// What its network has become, as a file, where it is to be kept.
    pub(crate) fn network(self) -> Option<String> {
        self.explorer?.finish()
    }

    fn tell(&mut self, events: &mut Vec<String>) {
        let changes = self.navigator.changes();
        let new = &changes[self.told..];
        events.extend(new.iter().map(|change| format!("{} → {}: {}", change.from, change.to, change.why)));
        self.told = changes.len();
    }

    fn record(&self, pose: &Navigated) -> NavigatedRecord {
        NavigatedRecord {
            object: self.targets[pose.object].name.clone(),
            object_from_camera: pose.standing.object_from_camera.rows(),
            covariance: rows6(&pose.standing.covariance.matrix),
        }
    }
}

/// Where the objects stand by the survey.
pub(crate) fn places(targets: &[Target]) -> Vec<Place> {
    let place = |target: &Target| Place {
        world_from_object: target.world_from_object.expect("checked when the source was opened"),
        covariance: target.survey.unwrap_or_else(|| Covariance6::<_, Object>::new(nalgebra::Matrix6::zeros())),
    };
    targets.iter().map(place).collect()
}
