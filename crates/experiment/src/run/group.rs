//! The trials that see the same passage, and what they make of its frames.

use std::path::Path;

use seafix_component::Fault;
use seafix_log::{FrameRecord, TrialHeader};
use seafix_referencing::{Glimpse, Target};
use seafix_simulation::{Purpose, Stream};

use super::RunError;
use crate::{
    Plan, Sighting, Trial,
    judge::judge,
    record,
    source::{Eyes, Passage, Sight},
};

/// The trials that see the same passage: they share its frames, so that they are compared on the
/// same noise.
pub(crate) struct Group<'a> {
    pub(crate) passage: Box<dyn Passage>,
    pub(crate) trials: Vec<&'a Trial>,
    /// What each trial searches for.
    targets: Vec<Vec<Target>>,
    /// What the log of each trial begins with.
    pub(super) headers: Vec<TrialHeader>,
    /// About how much log (bytes) one frame takes.
    pub(super) frame_bytes: u64,
}

/// What every trial of a group made of one frame, each object by itself.
pub(super) struct Looked {
    sight: Sight,
    sightings: Vec<Sighting>,
    /// Of each trial, what a joint fix takes from it.
    pub(super) glimpses: Vec<Glimpse>,
}

/// Opens every source once and checks what it needs.
pub(super) fn open(plan: &Plan) -> Result<Vec<Group<'_>>, RunError> {
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
            Ok(passage) => match frame_bytes(&*passage) {
                Ok(frame_bytes) => {
                    let (targets, headers) = (Vec::new(), Vec::new());
                    groups.push(Group { passage, trials: vec![trial], targets, headers, frame_bytes });
                }
                Err(fault) => faults.push(fault),
            },
            Err(more) => faults.extend(more),
        }
    }
    for group in &mut groups {
        for trial in &group.trials {
            match group.passage.site().targets(trial.stages.settings().target) {
                Ok(targets) => {
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

impl Group<'_> {
    /// How many frames before its own the answer to a frame looks back on.
    pub(super) fn looks_back(&self) -> usize {
        self.trials.iter().map(|trial| trial.stages.looks_back()).max().unwrap_or(0)
    }

    /// One frame through every trial. The sight is made once; every trial does all of its own work on it, so that times
    /// are its own.
    pub(super) fn look(&self, index: usize) -> Result<Looked, Fault> {
        let rig = self.passage.rig();
        let sight = self.passage.sight(index)?;
        let (mut sightings, mut glimpses) = (Vec::new(), Vec::new());
        for (trial, targets) in self.trials.iter().zip(&self.targets) {
            let mut stream = Stream::new(trial.resolved.seed, 0, self.passage.number(index), Purpose::Search);
            let sighting = trial.stages.reference(&sight, targets, rig, stream.rng());
            glimpses.push(trial.stages.glimpse(&sighting, targets, rig));
            sightings.push(sighting);
        }
        Ok(Looked { sight, sightings, glimpses })
    }

    /// The records of one frame, a trial each: what is solved together is joined, then truth is asked. `glimpses` are
    /// those of the frames before, the last of them the frame's own.
    pub(super) fn record(&self, index: usize, looked: Looked, glimpses: &[Vec<Glimpse>]) -> Vec<FrameRecord> {
        let passage = &*self.passage;
        let truth = passage.truth(index);
        let sightings = looked.sightings.into_iter().enumerate();
        sightings
            .zip(self.trials.iter().zip(&self.targets))
            .map(|((which, mut sighting), (trial, targets))| {
                if let Some((own, before)) = glimpses.split_last() {
                    let back = before.len().saturating_sub(trial.stages.looks_back());
                    let before: Vec<&Glimpse> = before[back..].iter().map(|all| &all[which]).collect();
                    trial.stages.join(&mut sighting, &before, &own[which], targets, passage.rig());
                }
                let mut record = record::frame(passage.number(index), &looked.sight, &sighting, trial, targets);
                if let Some(truth) = &truth {
                    let kind = trial.stages.settings().target;
                    judge(&mut record, &sighting, truth, passage.site(), targets, kind, passage.rig());
                }
                record
            })
            .collect()
    }
}

/// About how much log (bytes) one frame of a passage takes, by its first. Images, losslessly compressed to some 0.7 of
/// their size, are nearly all of it where there are any.
fn frame_bytes(passage: &dyn Passage) -> Result<u64, Fault> {
    const CLOUD_BYTES: f64 = 150e3;
    if passage.images() {
        let pixels = [passage.rig().left(), passage.rig().right()]
            .map(|camera| f64::from(camera.size()[0]) * f64::from(camera.size()[1]));
        return Ok((0.7 * (pixels[0] + pixels[1]) + CLOUD_BYTES) as u64);
    }
    let points = match passage.sight(0)?.eyes {
        Eyes::Points(cloud) => cloud.len(),
        Eyes::Pair(..) => 0,
    };
    // As measured on logs of 3 to 50 points, and a little more.
    Ok(4000 + 350 * points as u64)
}
