//! How long the stages took.

use std::time::Instant;

/// Milliseconds of each stage.
#[derive(Debug, Default)]
pub(super) struct Times(pub(super) Vec<(&'static str, f64)>);

impl Times {
    pub(super) fn add(&mut self, stage: &'static str, ms: f64) {
        match self.0.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((stage, ms)),
        }
    }

    pub(super) fn since(&mut self, stage: &'static str, start: Instant) {
        self.add(stage, start.elapsed().as_secs_f64() * 1e3);
    }
}
