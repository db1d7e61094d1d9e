//! The trials that see the same passage, and what they make of its frames.

use std::path::Path;

use rayon::prelude::*;
use seafix::{
    FrameData, FrameResult, Keyframes, NavigationSession, NavigationStack, NavigationState, OdometryResult,
    SensorFrame, TrialOdometry, View,
};
use seafix_component::Fault;
use seafix_data::source::{Sequence, own_site};
use seafix_log::{FrameRecord, SharedStages, TrialHeader};
use seafix_navigation::PoseGraph;
use seafix_referencing::{ObjectObservations, Site, Target, TargetKind};
use seafix_simulation::{Purpose, Stream};

use super::{
    RunError,
    sharing::{SharedFrame, Sharing},
};
use crate::{ImagesLogged, Plan, Trial, judge::Evaluator, odometry_fault::Motions, pictures::Levels, record};

/// The trials that see the same passage: they share its frames, so that they are compared on the
/// same noise.
pub(crate) struct Group<'a> {
    pub(crate) sequence: Box<dyn Sequence>,
    pub(crate) trials: Vec<&'a Trial>,
    /// Which of their stages are the same.
    sharing: Sharing,
    /// What each trial searches for.
    targets: Vec<Vec<Target>>,
    /// The network of an earlier run that each trial reads.
    pose_graphs: Vec<Option<PoseGraph>>,
    /// What the log of each trial begins with.
    pub(crate) headers: Vec<TrialHeader>,
    /// About how much log (bytes) one frame takes.
    pub(super) frame_bytes: u64,
}

/// The trials of a group on their way from frame to frame.
pub(super) struct Sessions<'a> {
    /// Of each trial that is the first with its odometry.
    odometries: Vec<Option<TrialOdometry<'a>>>,
    /// Of each trial that navigates.
    trials: Vec<Option<NavigationSession<'a>>>,
}

impl Sessions<'_> {
    /// Each odometry takes the next frame.
    ///
    /// # Errors
    /// A sentence: the frame is no stereo pair, or not after the one before.
    fn advance(&mut self, sensor_frame: &SensorFrame) -> Result<Vec<Option<OdometryResult>>, String> {
        let advance =
            |one: &mut Option<TrialOdometry<'_>>| one.as_mut().map(|one| one.advance(sensor_frame)).transpose();
        match self.odometries.iter().flatten().count() {
            0 | 1 => self.odometries.iter_mut().map(advance).collect(),
            _ => self.odometries.par_iter_mut().map(advance).collect(),
        }
    }

    /// Of each trial the network that it laid, where that is kept.
    pub(super) fn pose_graphs(self) -> impl Iterator<Item = Option<String>> {
        self.trials.into_iter().map(|session| session.and_then(NavigationSession::pose_graph))
    }
}

/// What every trial of a group made of one frame, each object by itself.
pub(super) struct GroupFrame {
    sensor_frame: SensorFrame,
    /// What there was to see, and what of it was searched for, where that is not the passage's.
    own: Option<(Site, Vec<Target>)>,
    /// Of each trial, what it saw, and what it knew then if it navigates.
    frame_results: Vec<(FrameResult, Option<NavigationState>)>,
    /// Of each trial, which of its stages it shared.
    shared: Vec<SharedStages>,
    /// Of each trial, what a joint fix takes from it.
    pub(super) observations_by_frame: Vec<ObjectObservations>,
}

/// Opens every source once and checks what it needs. Trials share their stages, unless each is measured `separate`ly.
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
        match trial.source.open(trial.resolved.seed, &plan.folder) {
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
                let what = "every problem is about an object of its own, and stands in no site";
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

/// The settings of a trial's key frames, where it has any.
fn keyframes(trial: &Trial) -> Option<&Keyframes> {
    trial.navigation_stack.as_ref()?.pose_graph.as_ref()
}

/// Why no trial can navigate through `sequence`.
fn unnavigable(sequence: &dyn Sequence, navigation_stack: &NavigationStack, targets: &[Target]) -> Option<Fault> {
    let fault = |what: &str, remedy: &str| {
        Some(Fault::new(format!("navigation {what}"), Path::new(sequence.name())).remedy(remedy))
    };
    if !sequence.images() {
        return fault("needs images, and this source gives points", "leave [navigation] out");
    }
    if navigation_stack.listens() && !sequence.has_readings() {
        let remedy =
            "navigate by images, odometry = \"stereo\", or take a dive or a data set with `doppler` and `gyro`";
        return fault("goes by a Doppler log and a gyro, and they are not both heard here", remedy);
    }
    let lost = targets.iter().find(|target| target.world_from_object.is_none())?;
    let what = format!("needs to know where every object stands; `{}` has no place in the world", lost.name);
    fault(&what, "add its `base_in_world` to the site, or leave [navigation] out")
}

impl Group<'_> {
    /// The files that its trials read besides the source's, with their SHA-256.
    pub(crate) fn pose_graphs_read(&self) -> impl Iterator<Item = (String, String)> {
        let read = self.trials.iter().filter_map(|trial| keyframes(trial)).filter(|one| !one.read.is_empty());
        read.map(|keyframes| (keyframes.read.clone(), keyframes.sha256.clone()))
    }

    /// How many frames before its own the answer to a frame looks back on.
    pub(super) fn window_length(&self) -> usize {
        self.trials.iter().map(|trial| trial.stages.window_length()).max().unwrap_or(0)
    }

    /// Whether what any trial knows after a frame is carried to the next.
    pub(super) fn navigates(&self) -> bool {
        self.trials.iter().any(|trial| trial.navigation_stack.is_some())
    }

    /// Sets out with every trial that navigates.
    pub(super) fn sessions(&self) -> Sessions<'_> {
        let trials = self.trials.iter().zip(&self.targets).zip(&self.pose_graphs);
        let sessions = trials.map(|((trial, targets), pose_graph)| {
            let navigation_stack = trial.navigation_stack.as_ref()?;
            let (rig, mounting) = (self.sequence.rig(), self.sequence.body_from_camera());
            let session =
                NavigationSession::begin(navigation_stack, &trial.stages, targets, rig, mounting, pose_graph.as_ref());
            let faults = trial.resolved.navigation.as_ref().map_or(&[][..], |navigation| &navigation.faults);
            let mut motions = Motions::default();
            Some(session.with_motion_filter(Box::new(move |time, motion| motions.passed(faults, time, motion))))
        });
        let odometries = self.trials.iter().enumerate().map(|(which, trial)| {
            let navigation_stack =
                trial.navigation_stack.as_ref().filter(|_| self.sharing.odometry_of(which) == which)?;
            Some(navigation_stack.begin_odometry(self.sequence.rig(), self.sequence.body_from_camera()))
        });
        Sessions { odometries: odometries.collect(), trials: sessions.collect() }
    }

    /// One frame through every trial. The sight is made once, and so is what trials share. `sessions` are the trials' ways
    /// until here.
    pub(super) fn observe(&self, index: usize, sessions: &mut Sessions<'_>) -> Result<GroupFrame, Fault> {
        let (sequence, number) = (&*self.sequence, self.sequence.number(index));
        let sensor_frame = sequence.sensor_frame(index)?;
        let own = own_site(&sensor_frame).map(|site| {
            let targets = site.targets(TargetKind::Object).expect("an object by itself needs no world");
            (site, targets)
        });
        let fault = |what: String| Fault::new(what, Path::new(sequence.name())).value(format!("frame {number}"));
        let shared = SharedFrame::new(self.trials.len());
        let moved = sessions.advance(&sensor_frame).map_err(fault)?;
        let observe = |(which, session): (usize, &mut Option<NavigationSession<'_>>)| {
            let trial = self.trials[which];
            let mut stream = Stream::new(trial.resolved.seed, 0, number, Purpose::Search);
            let targets = searched(&own, &self.targets[which]);
            let cloud =
                || shared.cloud(&self.sharing, which, || trial.stages.cloud(&sensor_frame.frame_data, sequence.rig()));
            match (session, &moved[self.sharing.odometry_of(which)]) {
                (Some(session), Some(moved)) => {
                    session.advance(&sensor_frame, moved, cloud, stream.rng()).map(|(seen, known)| (seen, Some(known)))
                }
                _ => {
                    let (view, priors) = (
                        View { sensor_frame: &sensor_frame, cloud: cloud(), targets, rig: sequence.rig() },
                        sensor_frame.prior_pose(targets),
                    );
                    let seek = || trial.stages.seek_all(view, &priors, stream.rng());
                    let sought = shared.sought(&self.sharing, which, seek);
                    Ok((trial.stages.fix_from(view, &priors, sought, stream.rng()), None))
                }
            }
        };
        // Where frames must wait for each other, trials need not.
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

    /// The records of one frame, a trial each: what is solved together is joined, then truth is asked. `observations_by_frame` are
    /// those of the frames before, the last of them the frame's own. Of a record that `logged` does not want, by the
    /// trial's place and what tables hold of it, only that is made. Beside them the frame's images, for the logs.
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

/// What a trial searches for in a frame: the frame's `own`, or what it always does.
fn searched<'a>(own: &'a Option<(Site, Vec<Target>)>, always: &'a [Target]) -> &'a [Target] {
    own.as_ref().map_or(always, |(_, targets)| targets)
}

/// About how much log (bytes) one frame of a passage takes for one trial, by its first. Images, losslessly compressed to
/// some 0.7 of their size, are nearly all of it where they are logged.
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
        FrameData::Points(cloud) => cloud.len(),
        FrameData::Stereo(..) => 0,
    };
    // As measured on logs of 3 to 50 points, and a little more.
    Ok(4000 + 350 * points as u64)
}
