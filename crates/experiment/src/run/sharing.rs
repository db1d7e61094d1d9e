//! Stages that several trials of a group share, computed once a frame.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use seafix::{Cloud, FrameResult, PipelineSettings, SearchResult};
use seafix_log::SharedStages;

use crate::experiment::Trial;

/// The common stages of a group's trials: for each trial, the index of the first trial with the same stage.
#[derive(Debug)]
pub(super) struct Sharing {
    front_end: Vec<usize>,
    search: Vec<usize>,
    odometry: Vec<usize>,
}

impl Sharing {
    /// Stages with equal resolved settings are shared, unless trials are measured `separate`ly.
    pub(super) fn of(trials: &[&Trial], separate: bool) -> Self {
        let first_alike = |alike: fn(&Trial, &Trial) -> bool| -> Vec<usize> {
            let first = |place: usize| {
                let same = |other: &usize| !separate && alike(trials[*other], trials[place]);
                (0..place).find(same).unwrap_or(place)
            };
            (0..trials.len()).map(first).collect()
        };
        Self {
            front_end: first_alike(same_front_end),
            search: first_alike(same_search),
            odometry: first_alike(same_odometry),
        }
    }

    /// The trial that computes the odometry of this one.
    pub(super) fn odometry_of(&self, trial: usize) -> usize {
        self.odometry[trial]
    }

    /// The stages of `frame_result` that this trial shares.
    pub(super) fn shared(&self, trial: usize, frame: &SharedFrame, frame_result: &FrameResult) -> SharedStages {
        let observed = frame_result.times.detect_ms.is_some();
        let searched = frame_result.attempts.iter().any(|attempt| attempt.times.search_ms.is_some());
        SharedStages {
            front_end: observed && frame.clouds[self.front_end[trial]].is_shared(),
            search: searched && frame.sought[self.search[trial]].is_shared(),
            odometry: self.odometry.iter().filter(|first| **first == self.odometry[trial]).count() > 1,
        }
    }
}

/// A guided front end depends on the priors of the targets as well. They are those of the frame without navigation;
/// with it they are the trial's own.
fn same_front_end(a: &Trial, b: &Trial) -> bool {
    let target = |trial: &Trial| trial.resolved.pipeline.target;
    let alone = |trial: &Trial| trial.navigation_stack.is_none();
    let same_priors = !a.stages.is_guided() || alone(a) && alone(b) && target(a) == target(b);
    same_priors && front_end(a) == front_end(b)
}

/// The pipeline with the defaults of all settings that act after the cloud and its lines.
fn front_end(trial: &Trial) -> PipelineSettings {
    let PipelineSettings {
        target, window, attempts, gate, expand_gates, tolerance, search, solver, acceptance, ..
    } = PipelineSettings::default();
    let own = trial.resolved.pipeline.clone();
    PipelineSettings { target, window, attempts, gate, expand_gates, tolerance, search, solver, acceptance, ..own }
}

/// Searches are shared only without navigation, because they then start from the same priors. With expanding gates the
/// random numbers of one target depend on the solver's result for the previous one.
fn same_search(a: &Trial, b: &Trial) -> bool {
    let searched = |trial: &Trial| {
        let PipelineSettings { target, attempts, gate, tolerance, search, .. } = trial.resolved.pipeline.clone();
        (target, attempts, gate, tolerance, search)
    };
    let alone = |trial: &Trial| trial.navigation_stack.is_none() && !trial.resolved.pipeline.expand_gates;
    alone(a) && alone(b) && same_front_end(a, b) && searched(a) == searched(b)
}

fn same_odometry(a: &Trial, b: &Trial) -> bool {
    let odometry = |trial: &Trial| trial.resolved.navigation.as_ref().map(|navigation| navigation.odometry.clone());
    odometry(a).is_some() && odometry(a) == odometry(b)
}

/// The shared results of one frame.
#[derive(Debug)]
pub(super) struct SharedFrame {
    clouds: Vec<Shared<Cloud>>,
    sought: Vec<Shared<Vec<Option<SearchResult>>>>,
}

impl SharedFrame {
    pub(super) fn new(trials: usize) -> Self {
        let one_each = 0..trials;
        Self {
            clouds: one_each.clone().map(|_| Shared::default()).collect(),
            sought: one_each.map(|_| Shared::default()).collect(),
        }
    }

    /// The cloud of a trial.
    pub(super) fn cloud(&self, sharing: &Sharing, trial: usize, make: impl FnOnce() -> Cloud) -> &Cloud {
        self.clouds[sharing.front_end[trial]].get(make)
    }

    /// The search results of a trial for every target; `None` if its search is not shared.
    pub(super) fn sought(
        &self,
        sharing: &Sharing,
        trial: usize,
        make: impl FnOnce() -> Vec<Option<SearchResult>>,
    ) -> Option<&[Option<SearchResult>]> {
        let first = sharing.search[trial];
        let others = sharing.search.iter().filter(|other| **other == first).count() > 1;
        others.then(|| &**self.sought[first].get(make))
    }
}

/// A result that its first user computes.
#[derive(Debug)]
struct Shared<T> {
    result: OnceLock<T>,
    users: AtomicUsize,
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self { result: OnceLock::new(), users: AtomicUsize::new(0) }
    }
}

impl<T> Shared<T> {
    fn get(&self, make: impl FnOnce() -> T) -> &T {
        self.users.fetch_add(1, Ordering::Relaxed);
        self.result.get_or_init(make)
    }

    /// Whether several trials used it.
    fn is_shared(&self) -> bool {
        self.users.load(Ordering::Relaxed) > 1
    }
}
