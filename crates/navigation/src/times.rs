//! Computing time of the stages.

use std::time::Instant;

/// Total time of each stage (ms).
#[derive(Debug, Default)]
pub(crate) struct Times(pub(crate) Vec<(&'static str, f64)>);

impl Times {
    pub(crate) fn add(&mut self, stage: &'static str, ms: f64) {
        match self.0.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((stage, ms)),
        }
    }

    pub(crate) fn since(&mut self, stage: &'static str, start: Instant) {
        self.add(stage, start.elapsed().as_secs_f64() * 1e3);
    }
}
