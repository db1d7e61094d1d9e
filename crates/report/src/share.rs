//! How sure a share of the attempts is.

use seafix_evaluation::{Bootstrap, clopper_pearson};
use seafix_log::TrialHeader;

use crate::paired::SEED;

/// Whether the frames of a trial follow each other on one way. They do not where every frame brings an object of its own,
/// so that the header can name none, nor where every frame draws one of many layouts: then each is a draw by itself.
pub(crate) fn is_trajectory(header: &TrialHeader) -> bool {
    !header.targets.is_empty() && !header.configuration.contains("name = \"virtual-layouts\"")
}

/// The 95 % interval of the share of events among the attempts, in order of time: of a trajectory by the bootstrap over
/// blocks of consecutive attempts, of independent draws the exact one of Clopper and Pearson.
pub(crate) fn interval(trajectory: bool, events: &[bool]) -> (f64, f64) {
    if trajectory && !events.is_empty() {
        return Bootstrap::of(events.len(), SEED).share(events, 0.95);
    }
    clopper_pearson(events.iter().filter(|event| **event).count(), events.len(), 0.95)
}

/// The intervals of several shares of the same attempts.
pub(crate) fn intervals(trajectory: bool, all: &[Vec<bool>]) -> Vec<(f64, f64)> {
    match all.first() {
        Some(first) if trajectory && !first.is_empty() => {
            Bootstrap::of(first.len(), SEED).shares(all.iter().map(Vec::as_slice), 0.95)
        }
        _ => all.iter().map(|events| interval(trajectory, events)).collect(),
    }
}

/// What a caption calls the intervals of these trials.
pub(crate) fn called<'a>(mut headers: impl Iterator<Item = &'a TrialHeader>) -> &'static str {
    if headers.any(is_trajectory) { "95 % intervals (block bootstrap)" } else { "exact 95 % intervals" }
}
