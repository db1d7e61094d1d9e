//! The trials with the same sequence, and their results for its frames.

use std::path::Path;

use rayon::prelude::*;
use seafix::{
    FrameData, FrameOdometry, FrameResult, KeyframeSettings, NavigationSession, NavigationStack, NavigationState,
    OdometryResult, SensorFrame, View,
};
use seafix_component::{Fault, decoded, undecodable};
use seafix_data::source::{Sequence, own_site};
use seafix_log::{FrameRecord, SharedStages, TrialHeader};
use seafix_navigation::PoseGraph;
use seafix_referencing::{ObjectObservations, Site, Target, TargetKind};
use seafix_simulation::{Purpose, Stream};
use seafix_vision::Regions;

use crate::{
    experiment::{Plan, Trial},
    judge::Evaluator,
    logging::ImagesLogged,
    odometry_fault::Motions,
    pictures::Levels,
    record,
    run::{
        outcome::RunError,
        sharing::{SharedFrame, Sharing},
    },
};

/// The trials with the same sequence. They share its frames, so that they are compared on the same noise.
pub(crate) struct Group<'a> {
    pub(crate) sequence: Box<dyn Sequence>,
    pub(crate) trials: Vec<&'a Trial>,
    /// The stages with equal settings.
    sharing: Sharing,
    /// The targets of each trial.
    targets: Vec<Vec<Target>>,
    /// The pose graph of an earlier run for each trial.
    pose_graphs: Vec<Option<PoseGraph>>,
    /// The log header of each trial.
    pub(crate) headers: Vec<TrialHeader>,
    /// The approximate size of a frame in a log (bytes).
    pub(super) frame_bytes: u64,
}

/// The odometries and navigation sessions of a group.
pub(super) struct Sessions<'a> {
    /// The odometry of each trial that is the first with it.
    odometries: Vec<Option<FrameOdometry<'a>>>,
    /// The session of each trial that navigates.
    trials: Vec<Option<NavigationSession<'a>>>,
}

impl Sessions<'_> {
    /// Processes the next frame with each odometry.
    ///
    /// # Errors
    /// The cause as a sentence: a frame without images, or one that is not later than the previous frame.
    fn advance(&mut self, sensor_frame: &SensorFrame) -> Result<Vec<Option<OdometryResult>>, String> {
        let advance =
            |one: &mut Option<FrameOdometry<'_>>| one.as_mut().map(|one| one.advance(sensor_frame)).transpose();
        match self.odometries.iter().flatten().count() {
            0 | 1 => self.odometries.iter_mut().map(advance).collect(),
            _ => self.odometries.par_iter_mut().map(advance).collect(),
        }
    }

    /// The pose graph of each trial that keeps one.
    pub(super) fn pose_graphs(self) -> impl Iterator<Item = Option<String>> {
        self.trials.into_iter().map(|session| session.and_then(NavigationSession::into_pose_graph_text))
    }
}

/// The results of every trial of a group for one frame, before joint fixes.
pub(super) struct GroupFrame {
    sensor_frame: SensorFrame,
    /// The site and the targets of the frame, if they are not those of the sequence.
    own: Option<(Site, Vec<Target>)>,
    /// The result of each trial, and its state if it navigates.
    frame_results: Vec<(FrameResult, Option<NavigationState>)>,
    /// The stages that each trial shared.
    shared: Vec<SharedStages>,
    /// The observations for a joint fix of each trial.
    pub(super) observations_by_frame: Vec<ObjectObservations>,
}

/// Opens every source once and checks the requirements of its trials. Trials share stages unless they are measured
/// `separate`ly.
pub(crate) fn open(plan: &Plan, separate: bool) -> Result<Vec<Group<'_>>, RunError> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut faults = Vec::new();
    for trial in &plan.trials {
        let same = |other: &Trial| {
            other.resolved.source == trial.resolved.source && other.resolved.seed == trial.resolved.seed
        };
        if let Some(group) = groups.iter_mut().find(|group| same(group.trials[0])) {
            group.trials.push(trial);
            continue;
        }
        let open = || trial.source.open(trial.resolved.seed, &plan.folder);
        match decoded(open, |message| vec![undecodable(Path::new(&trial.resolved.source.name), message)]) {
            Ok(sequence) => match frame_bytes(&*sequence, trial.resolved.log.images) {
                Ok(frame_bytes) => {
                    let (targets, pose_graphs, headers) = (Vec::new(), Vec::new(), Vec::new());
                    let (trials, sharing) = (vec![trial], Sharing::of(&[], separate));
                    groups.push(Group { sequence, trials, sharing, targets, pose_graphs, headers, frame_bytes });
                }
                Err(fault) => faults.push(fault),
            },
            Err(more) => faults.extend(more),
        }
    }
    for group in &mut groups {
        group.sharing = Sharing::of(&group.trials, separate);
        for trial in &group.trials {
            let kind = trial.stages.settings().target;
            if group.sequence.posed() && kind != TargetKind::Object {
                let what = "a coherence problem has no site";
                faults.push(Fault::new(what, Path::new(group.sequence.name())).remedy("use target = \"object\""));
                continue;
            }
            match group.sequence.site().targets(kind) {
                Ok(targets) => {
                    if let Some(navigation_stack) = &trial.navigation_stack {
                        faults.extend(unnavigable(&*group.sequence, navigation_stack, &targets));
                    }
                    match keyframes(trial).map_or(Ok(None), |used| crate::keyframes::open(used, &plan.folder)) {
                        Ok(pose_graph) => group.pose_graphs.push(pose_graph),
                        Err(fault) => faults.push(fault),
                    }
                    group.headers.push(record::header(plan, trial, &*group.sequence, &targets));
                    group.targets.push(targets);
                }
                Err(error) => faults.push(Fault::new(error.to_string(), Path::new(group.sequence.name()))),
            }
        }
    }
    faults.dedup();
    if faults.is_empty() { Ok(groups) } else { Err(RunError::Input(faults)) }
}

/// The settings of a trial's key frames, if there are any.
fn keyframes(trial: &Trial) -> Option<&KeyframeSettings> {
    trial.navigation_stack.as_ref()?.pose_graph.as_ref()
}

/// The fault that prevents navigation through `sequence`.
fn unnavigable(sequence: &dyn Sequence, navigation_stack: &NavigationStack, targets: &[Target]) -> Option<Fault> {
    let fault = |what: &str, remedy: &str| {
        Some(Fault::new(format!("navigation {what}"), Path::new(sequence.name())).remedy(remedy))
    };
    if !sequence.images() {
        return fault("needs images, but this source has points", "remove [navigation]");
    }
    if navigation_stack.needs_readings() && !sequence.has_readings() {
        let remedy = "use odometry = \"stereo\", or a dive or a data set with `doppler` and `gyro`";
        return fault("needs readings of a Doppler log and a gyro, which this source does not have", remedy);
    }
    let lost = targets.iter().find(|target| target.world_from_object.is_none())?;
    let what = format!("needs the pose of every object; `{}` has none in the world", lost.name);
    fault(&what, "add its `base_in_world` to the site, or remove [navigation]")
}

impl Group<'_> {
    /// The files other than the source's that its trials read, with their SHA-256.
    pub(crate) fn pose_graphs_read(&self) -> impl Iterator<Item = (String, String)> {
        let read = self.trials.iter().filter_map(|trial| keyframes(trial)).filter(|one| !one.read.is_empty());
        read.map(|keyframes| (keyframes.read.clone(), keyframes.sha256.clone()))
    }

    /// The number of preceding frames in a joint fix.
    pub(super) fn window_length(&self) -> usize {
        self.trials.iter().map(|trial| trial.stages.window_length()).max().unwrap_or(0)
    }

    /// Whether the state of a trial is carried from frame to frame.
    pub(super) fn navigates(&self) -> bool {
        self.trials.iter().any(|trial| trial.navigation_stack.is_some())
    }

    /// Begins the sessions of the trials that navigate.
    pub(super) fn sessions(&self) -> Sessions<'_> {
        let trials = self.trials.iter().zip(&self.targets).zip(&self.pose_graphs);
        let sessions = trials.map(|((trial, targets), pose_graph)| {
            let navigation_stack = trial.navigation_stack.as_ref()?;
            let (rig, mounting) = (self.sequence.rig(), self.sequence.body_from_camera());
            let session =
                NavigationSession::begin(navigation_stack, &trial.stages, targets, rig, mounting, pose_graph.as_ref());
            let faults = trial.resolved.navigation.as_ref().map_or(&[][..], |navigation| &navigation.faults);
            let mut motions = Motions::default();
            Some(session.with_motion_override(Box::new(move |time, motion| motions.passed(faults, time, motion))))
        });
        let odometries = self.trials.iter().enumerate().map(|(which, trial)| {
            let navigation_stack =
                trial.navigation_stack.as_ref().filter(|_| self.sharing.odometry_of(which) == which)?;
            Some(navigation_stack.begin_odometry(self.sequence.rig(), self.sequence.body_from_camera()))
        });
        Sessions { odometries: odometries.collect(), trials: sessions.collect() }
    }

    /// Processes one frame with every trial. The frame and the common stages are computed once. `sessions` have
    /// processed the frames before.
    pub(super) fn observe(&self, index: usize, sessions: &mut Sessions<'_>) -> Result<GroupFrame, Fault> {
        let (sequence, number) = (&*self.sequence, self.sequence.number(index));
        let undecodable = |message| undecodable(Path::new(sequence.name()), message);
        let sensor_frame = decoded(|| sequence.sensor_frame(index), undecodable)?;
        let own = own_site(&sensor_frame).map(|site| {
            let targets = site.targets(TargetKind::Object).expect("targets of single objects need no world");
            (site, targets)
        });
        let fault = |what: String| Fault::new(what, Path::new(sequence.name())).value(format!("frame {number}"));
        let shared = SharedFrame::new(self.trials.len());
        let moved = sessions.advance(&sensor_frame).map_err(fault)?;
        let observe = |(which, session): (usize, &mut Option<NavigationSession<'_>>)| {
            let trial = self.trials[which];
            let mut stream = Stream::new(trial.resolved.seed, 0, number, Purpose::Search);
            let targets = searched(&own, &self.targets[which]);
            let cloud = |regions: &[Regions; 2]| {
                let make = || trial.stages.cloud(&sensor_frame.frame_data, sequence.rig(), targets, regions);
                shared.cloud(&self.sharing, which, make)
            };
            match (session, &moved[self.sharing.odometry_of(which)]) {
                (Some(session), Some(moved)) => {
                    session.advance(&sensor_frame, moved, cloud, stream.rng()).map(|(seen, known)| (seen, Some(known)))
                }
                _ => {
                    let priors = sensor_frame.target_priors(targets);
                    let regions = trial.stages.regions(targets, &[&priors], sequence.rig());
                    let cloud = cloud(&regions);
                    let view = View { sensor_frame: &sensor_frame, cloud, targets, rig: sequence.rig() };
                    let seek = || trial.stages.search_all(view, &priors, stream.rng());
                    let sought = shared.sought(&self.sharing, which, seek);
                    Ok((trial.stages.fix_from(view, &priors, sought, stream.rng()), None))
                }
            }
        };
        // Trials of one frame run in parallel where frames must run in sequence.
        let frame_results: Result<Vec<_>, String> = match self.navigates() {
            true => sessions.trials.par_iter_mut().enumerate().map(observe).collect(),
            false => sessions.trials.iter_mut().enumerate().map(observe).collect(),
        };
        let mut frame_results = frame_results.map_err(fault)?;
        let (mut observations_by_frame, mut stages) =
            (Vec::with_capacity(frame_results.len()), Vec::with_capacity(frame_results.len()));
        for (which, (frame_result, _)) in frame_results.iter_mut().enumerate() {
            stages.push(self.sharing.shared(which, &shared, frame_result));
            let targets = searched(&own, &self.targets[which]);
            observations_by_frame.push(self.trials[which].stages.object_observations(
                frame_result,
                targets,
                sequence.rig(),
            ));
        }
        Ok(GroupFrame { sensor_frame, own, frame_results, shared: stages, observations_by_frame })
    }

    /// The records of one frame, one a trial: joint fixes first, then the evaluation. `observations_by_frame` are those
    /// of the preceding frames and, last, of this one. `logged` decides, by the index of the trial and its tabular
    /// record, whether the complete record is made. The frame's images for the logs are returned too.
    pub(super) fn record(
        &self,
        index: usize,
        group_frame: GroupFrame,
        observations_by_frame: &[Vec<ObjectObservations>],
        mut logged: impl FnMut(usize, &FrameRecord) -> bool,
    ) -> (Vec<FrameRecord>, Levels) {
        let sequence = &*self.sequence;
        let truth = sequence.truth(index);
        let site = group_frame.own.as_ref().map_or(sequence.site(), |(site, _)| site);
        let frame_results = group_frame.frame_results.into_iter().enumerate();
        let mut levels = Levels::default();
        let records = frame_results
            .zip(self.trials.iter().zip(&self.targets))
            .map(|((which, (mut frame_result, navigation_state)), (trial, targets))| {
                let targets = searched(&group_frame.own, targets);
                if let Some((own, before)) = observations_by_frame.split_last() {
                    let back = before.len().saturating_sub(trial.stages.window_length());
                    let before: Vec<&ObjectObservations> = before[back..].iter().map(|all| &all[which]).collect();
                    trial.stages.join(&mut frame_result, &before, &own[which], targets, sequence.rig());
                }
                let number = sequence.number(index);
                let mut record = record::frame(
                    number,
                    &group_frame.sensor_frame,
                    &frame_result,
                    navigation_state.as_ref(),
                    group_frame.shared[which],
                    trial,
                    targets,
                );
                let kind = trial.stages.settings().target;
                let judge = truth.as_ref().map(|truth| Evaluator { truth, site, targets, kind, rig: sequence.rig() });
                if let Some(judge) = &judge {
                    judge.evaluate(&mut record, &frame_result, navigation_state.as_ref());
                }
                if logged(which, &record) {
                    let images = levels.at(trial.resolved.log.images, &group_frame.sensor_frame.frame_data);
                    record::complete(&mut record, &group_frame.sensor_frame, &frame_result, targets, images);
                    judge.iter().for_each(|judge| judge.annotate(&mut record));
                }
                record
            })
            .collect();
        (records, levels)
    }
}

/// The targets of a trial in a frame: the frame's `own`, or those of the sequence.
fn searched<'a>(own: &'a Option<(Site, Vec<Target>)>, always: &'a [Target]) -> &'a [Target] {
    own.as_ref().map_or(always, |(_, targets)| targets)
}

/// The approximate size (bytes) of a frame in one trial's log, from the first frame. Logged images dominate; lossless
/// compression reduces them to about 0.7 of their size.
fn frame_bytes(sequence: &dyn Sequence, level: ImagesLogged) -> Result<u64, Fault> {
    const CLOUD_BYTES: f64 = 150e3;
    if sequence.images() {
        let pixels = [sequence.rig().left(), sequence.rig().right()].map(|camera| {
            let factor = f64::from(level.factor(camera.size()[0]));
            f64::from(camera.size()[0]) * f64::from(camera.size()[1]) / (factor * factor)
        });
        let fraction = if level == ImagesLogged::None { 0.0 } else { 0.7 };
        return Ok((fraction * (pixels[0] + pixels[1]) + CLOUD_BYTES) as u64);
    }
    let points = match sequence.sensor_frame(0)?.frame_data {
        FrameData::Points(cloud) | FrameData::Features(cloud, _) => cloud.len(),
        FrameData::Stereo(..) => 0,
    };
    // A fit to logs with 3 to 50 points, with some reserve.
    Ok(4000 + 350 * points as u64)
}
