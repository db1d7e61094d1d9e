//! A scale error that the fixes of a trial agree about: a focal length, a baseline or a survey that is off.

use seafix_log::{TargetRecord, quantities};

/// The minimum number of fixes.
const MIN_FIXES: usize = 3;
/// The minimum error.
const MIN: f64 = 0.01;
/// The minimum number of standard deviations.
const SIGMAS: f64 = 5.0;

/// The weighted mean of the scale errors of a trial's fixes, which are independent.
#[derive(Debug, Default)]
pub(crate) struct ScaleError {
    fixes: usize,
    /// Σ 1/σ² and Σ ε/σ².
    weight: f64,
    sum: f64,
}

impl ScaleError {
    /// Adds an attempt, if it has a scale error with a standard deviation.
    pub(crate) fn add(&mut self, target: &TargetRecord) {
        let estimate = quantities::SCALE_ERROR.of(target).zip(quantities::SCALE_ERROR_SIGMA.of(target));
        if let Some((value, sigma)) = estimate.filter(|(_, sigma)| *sigma > 0.0) {
            self.fixes += 1;
            self.weight += sigma.powi(-2);
            self.sum += value * sigma.powi(-2);
        }
    }

    /// The sentence of an error above 1 % and five standard deviations.
    pub(crate) fn warning(&self) -> Option<String> {
        let mean = self.sum / self.weight;
        let is_sure = self.fixes >= MIN_FIXES && mean.abs() > MIN && mean.abs() > SIGMAS * self.weight.sqrt().recip();
        let longer = if mean > 0.0 { "longer" } else { "shorter" };
        is_sure.then(|| {
            format!(
                "measured distances are {:.1} % {longer} than the model's in {} fixes; check baseline, focal length and survey",
                100.0 * mean.abs(),
                self.fixes
            )
        })
    }
}
