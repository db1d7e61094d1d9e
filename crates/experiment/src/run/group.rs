//! The trials that see the same passage, and what they make of its frames.

use std::path::Path;

use rayon::prelude::*;
use seafix::{Eyes, Helm, Keyframes, OdometryResult, OdometrySession, Sight, Sighting, Underway, View, Voyage};
use seafix_component::Fault;
use seafix_data::source::{Passage, own_site};
use seafix_log::{FrameRecord, SharedStages, TrialHeader};
use seafix_navigation::Network;
use seafix_referencing::{Glimpse, Site, Target, TargetKind};
use seafix_simulation::{Purpose, Stream};

use super::{
    RunError,
    share::{SharedFrame, Sharing},
};
use crate::{ImagesLogged, Plan, Trial, judge::Judge, odometry_fault::Motions, pictures::Levels, record};

/// The trials that see the same passage: they share its frames, so that they are compared on the
/// same noise.
pub(crate) struct Group<'a> {
    pub(crate) passage: Box<dyn Passage>,
    pub(crate) trials: Vec<&'a Trial>,
    /// Which of their stages are the same.
    sharing: Sharing,
    /// What each trial searches for.
    targets: Vec<Vec<Target>>,
    /// The network of an earlier run that each trial reads.
    networks: Vec<Option<Network>>,
    /// What the log of each trial begins with.
    pub(crate) headers: Vec<TrialHeader>,
    /// About how much log (bytes) one frame takes.
    pub(super) frame_bytes: u64,
}

/// The trials of a group on their way from frame to frame.
pub(super) struct Voyages<'a> {
    /// Of each trial that is the first with its odometry.
    odometries: Vec<Option<OdometrySession<'a>>>,
    /// Of each trial that navigates.
    trials: Vec<Option<Voyage<'a>>>,
}

impl Voyages<'_> {
    /// Each odometry takes the next frame.
    ///
    /// # Errors
    /// A sentence: the frame is no stereo pair, or not after the one before.
    fn advance(&mut self, sight: &Sight) -> Result<Vec<Option<OdometryResult>>, String> {
        let advance = |one: &mut Option<OdometrySession<'_>>| one.as_mut().map(|one| one.advance(sight)).transpose();
        match self.odometries.iter().flatten().count() {
            0 | 1 => self.odometries.iter_mut().map(advance).collect(),
            _ => self.odometries.par_iter_mut().map(advance).collect(),
        }
    }

    /// Of each trial the network that it laid, where that is kept.
    pub(super) fn networks(self) -> impl Iterator<Item = Option<String>> {
        self.trials.into_iter().map(|voyage| voyage.and_then(Voyage::network))
    }
}

/// What every trial of a group made of one frame, each object by itself.
pub(super) struct Looked {
    sight: Sight,
    /// What there was to see, and what of it was searched for, where that is not the passage's.
    own: Option<(Site, Vec<Target>)>,
    /// Of each trial, what it saw, and what it knew then if it navigates.
    sightings: Vec<(Sighting, Option<Underway>)>,
    /// Of each trial, which of its stages it shared.
    shared: Vec<SharedStages>,
    /// Of each trial, what a joint fix takes from it.
    pub(super) glimpses: Vec<Glimpse>,
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
            Ok(passage) => match frame_bytes(&*passage, trial.resolved.log.images) {
                Ok(frame_bytes) => {
                    let (targets, networks, headers) = (Vec::new(), Vec::new(), Vec::new());
                    let (trials, sharing) = (vec![trial], Sharing::of(&[], separate));
                    groups.push(Group { passage, trials, sharing, targets, networks, headers, frame_bytes });
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
            if group.passage.posed() && kind != TargetKind::Object {
                let what = "every problem is about an object of its own, and stands in no site";
                faults.push(Fault::new(what, Path::new(group.passage.name())).remedy("use target = \"object\""));
                continue;
            }
            match group.passage.site().targets(kind) {
                Ok(targets) => {
                    if let Some(helm) = &trial.helm {
                        faults.extend(unnavigable(&*group.passage, helm, &targets));
                    }
                    match keyframes(trial).map_or(Ok(None), |used| crate::keyframes::open(used, &plan.folder)) {
                        Ok(network) => group.networks.push(network),
                        Err(fault) => faults.push(fault),
                    }
                    group.headers.push(record::header(plan, trial, &*group.passage, &targets));
                    group.targets.push(targets);
                }
                Err(error) => faults.push(Fault::new(error.to_string(), Path::new(group.passage.name()))),
            }
        }
    }
    faults.dedup();
    if faults.is_empty() { Ok(groups) } else { Err(RunError::Input(faults)) }
}

/// The settings of a trial's key frames, where it has any.
fn keyframes(trial: &Trial) -> Option<&Keyframes> {
    trial.helm.as_ref()?.network.as_ref()
}

/// Why no trial can navigate through `passage`.
fn unnavigable(passage: &dyn Passage, helm: &Helm, targets: &[Target]) -> Option<Fault> {
    let fault = |what: &str, remedy: &str| {
        Some(Fault::new(format!("navigation {what}"), Path::new(passage.name())).remedy(remedy))
    };
    if !passage.images() {
        return fault("needs images, and this source gives points", "leave [navigation] out");
    }
    if helm.listens() && !passage.hears() {
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
    pub(crate) fn networks_read(&self) -> impl Iterator<Item = (String, String)> {
        let read = self.trials.iter().filter_map(|trial| keyframes(trial)).filter(|one| !one.read.is_empty());
        read.map(|keyframes| (keyframes.read.clone(), keyframes.sha256.clone()))
    }

    /// How many frames before its own the answer to a frame looks back on.
    pub(super) fn looks_back(&self) -> usize {
        self.trials.iter().map(|trial| trial.stages.looks_back()).max().unwrap_or(0)
    }

    /// Whether what any trial knows after a frame is carried to the next.
    pub(super) fn navigates(&self) -> bool {
        self.trials.iter().any(|trial| trial.helm.is_some())
    }

    /// Sets out with every trial that navigates.
    pub(super) fn voyages(&self) -> Voyages<'_> {
        let trials = self.trials.iter().zip(&self.targets).zip(&self.networks);
        let voyages = trials.map(|((trial, targets), network)| {
            let helm = trial.helm.as_ref()?;
            let (rig, mounting) = (self.passage.rig(), self.passage.body_from_camera());
            let voyage = Voyage::begin(helm, &trial.stages, targets, rig, mounting, network.as_ref());
            let faults = trial.resolved.navigation.as_ref().map_or(&[][..], |navigation| &navigation.faults);
            let mut motions = Motions::default();
            Some(voyage.with_motion_filter(Box::new(move |time, motion| motions.passed(faults, time, motion))))
        });
        let odometries = self.trials.iter().enumerate().map(|(which, trial)| {
            let helm = trial.helm.as_ref().filter(|_| self.sharing.odometry_of(which) == which)?;
            Some(helm.begin_odometry(self.passage.rig(), self.passage.body_from_camera()))
        });
        Voyages { odometries: odometries.collect(), trials: voyages.collect() }
    }

    /// One frame through every trial. The sight is made once, and so is what trials share. `voyages` are the trials' ways
    /// until here.
    pub(super) fn look(&self, index: usize, voyages: &mut Voyages<'_>) -> Result<Looked, Fault> {
        let (passage, number) = (&*self.passage, self.passage.number(index));
        let sight = passage.sight(index)?;
        let own = own_site(&sight).map(|site| {
            let targets = site.targets(TargetKind::Object).expect("an object by itself needs no world");
            (site, targets)
        });
        let fault = |what: String| Fault::new(what, Path::new(passage.name())).value(format!("frame {number}"));
        let shared = SharedFrame::new(self.trials.len());
        let moved = voyages.advance(&sight).map_err(fault)?;
        let look = |(which, voyage): (usize, &mut Option<Voyage<'_>>)| {
            let trial = self.trials[which];
            let mut stream = Stream::new(trial.resolved.seed, 0, number, Purpose::Search);
            let targets = searched(&own, &self.targets[which]);
            let cloud = || shared.cloud(&self.sharing, which, || trial.stages.cloud(&sight.eyes, passage.rig()));
            match (voyage, &moved[self.sharing.odometry_of(which)]) {
                (Some(voyage), Some(moved)) => {
                    voyage.advance(&sight, moved, cloud, stream.rng()).map(|(seen, known)| (seen, Some(known)))
                }
                _ => {
                    let (view, priors) =
                        (View { sight: &sight, cloud: cloud(), targets, rig: passage.rig() }, sight.rough(targets));
                    let seek = || trial.stages.seek_all(view, &priors, stream.rng());
                    let sought = shared.sought(&self.sharing, which, seek);
                    Ok((trial.stages.reference_from(view, &priors, sought, stream.rng()), None))
                }
            }
        };
        // Where frames must wait for each other, trials need not.
        let sightings: Result<Vec<_>, String> = match self.navigates() {
            true => voyages.trials.par_iter_mut().enumerate().map(look).collect(),
            false => voyages.trials.iter_mut().enumerate().map(look).collect(),
        };
        let mut sightings = sightings.map_err(fault)?;
        let (mut glimpses, mut stages) = (Vec::with_capacity(sightings.len()), Vec::with_capacity(sightings.len()));
        for (which, (sighting, _)) in sightings.iter_mut().enumerate() {
            stages.push(self.sharing.shared(which, &shared, sighting));
            let targets = searched(&own, &self.targets[which]);
            glimpses.push(self.trials[which].stages.glimpse(sighting, targets, passage.rig()));
        }
        Ok(Looked { sight, own, sightings, shared: stages, glimpses })
    }

    /// The records of one frame, a trial each: what is solved together is joined, then truth is asked. `glimpses` are
    /// those of the frames before, the last of them the frame's own. Of a record that `logged` does not want, by the
    /// trial's place and what tables hold of it, only that is made. Beside them the frame's images, for the logs.
    pub(super) fn record(
        &self,
        index: usize,
        looked: Looked,
        glimpses: &[Vec<Glimpse>],
        mut logged: impl FnMut(usize, &FrameRecord) -> bool,
    ) -> (Vec<FrameRecord>, Levels) {
        let passage = &*self.passage;
        let truth = passage.truth(index);
        let site = looked.own.as_ref().map_or(passage.site(), |(site, _)| site);
        let sightings = looked.sightings.into_iter().enumerate();
        let mut levels = Levels::default();
        let records = sightings
            .zip(self.trials.iter().zip(&self.targets))
            .map(|((which, (mut sighting, underway)), (trial, targets))| {
                let targets = searched(&looked.own, targets);
                if let Some((own, before)) = glimpses.split_last() {
                    let back = before.len().saturating_sub(trial.stages.looks_back());
                    let before: Vec<&Glimpse> = before[back..].iter().map(|all| &all[which]).collect();
                    trial.stages.join(&mut sighting, &before, &own[which], targets, passage.rig());
                }
                let number = passage.number(index);
                let mut record = record::frame(
                    number,
                    &looked.sight,
                    &sighting,
                    underway.as_ref(),
                    looked.shared[which],
                    trial,
                    targets,
                );
                let kind = trial.stages.settings().target;
                let judge = truth.as_ref().map(|truth| Judge { truth, site, targets, kind, rig: passage.rig() });
                if let Some(judge) = &judge {
                    judge.evaluate(&mut record, &sighting, underway.as_ref());
                }
                if logged(which, &record) {
                    let images = levels.at(trial.resolved.log.images, &looked.sight.eyes);
                    record::complete(&mut record, &looked.sight, &sighting, targets, images);
                    judge.iter().for_each(|judge| judge.tell(&mut record));
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
fn frame_bytes(passage: &dyn Passage, level: ImagesLogged) -> Result<u64, Fault> {
    const CLOUD_BYTES: f64 = 150e3;
    if passage.images() {
        let pixels = [passage.rig().left(), passage.rig().right()].map(|camera| {
            let factor = f64::from(level.factor(camera.size()[0]));
            f64::from(camera.size()[0]) * f64::from(camera.size()[1]) / (factor * factor)
        });
        let share = if level == ImagesLogged::None { 0.0 } else { 0.7 };
        return Ok((share * (pixels[0] + pixels[1]) + CLOUD_BYTES) as u64);
    }
    let points = match passage.sight(0)?.eyes {
        Eyes::Points(cloud) => cloud.len(),
        Eyes::Pair(..) => 0,
    };
    // As measured on logs of 3 to 50 points, and a little more.
    Ok(4000 + 350 * points as u64)
}
