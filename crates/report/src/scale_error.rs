//! A scale or depth error that the fixes of a trial agree about: a focal length, a baseline or a survey that is off.

use seafix_log::{
    TargetRecord,
    quantities::{self, Quantity},
};

/// The minimum number of fixes.
const MIN_FIXES: usize = 3;
/// The minimum error.
const MIN: f64 = 0.01;
/// The minimum number of standard deviations.
const SIGMAS: f64 = 5.0;

/// The scale and the depth errors of a trial's fixes.
#[derive(Debug, Default)]
pub(crate) struct ScaleErrors {
    scale: WeightedMean,
    depth: WeightedMean,
}

impl ScaleErrors {
    /// Adds an attempt, if it has such errors with standard deviations.
    pub(crate) fn add(&mut self, target: &TargetRecord) {
        let add = |mean: &mut WeightedMean, value: &Quantity, sigma: &Quantity| {
            if let Some((value, sigma)) = value.of(target).zip(sigma.of(target)).filter(|(_, sigma)| *sigma > 0.0) {
                mean.add(value, sigma);
            }
        };
        add(&mut self.scale, &quantities::SCALE_ERROR, &quantities::SCALE_ERROR_SIGMA);
        add(&mut self.depth, &quantities::DEPTH_ERROR, &quantities::DEPTH_ERROR_SIGMA);
    }

    /// The sentence of an error above 1 % and five standard deviations; of two, of the more significant one.
    ///
    /// A wrong baseline shows in both, a wrong focal length in the depth alone.
    pub(crate) fn warning(&self) -> Option<String> {
        let scale = ("measured distances", &self.scale, "baseline, focal length and survey");
        let depth =
            ("distances along the optical axis", &self.depth, "the focal length: was the rig calibrated in air?");
        let certain = [depth, scale].into_iter().filter(|(_, mean, _)| mean.is_certain());
        let (what, mean, check) = certain.max_by(|(_, a, _), (_, b, _)| a.sigmas().total_cmp(&b.sigmas()))?;
        let longer = if mean.mean() > 0.0 { "longer" } else { "shorter" };
        let (by, fixes) = (100.0 * mean.mean().abs(), mean.fixes);
        Some(format!("{what} are {by:.1} % {longer} than the model's in {fixes} fixes; check {check}"))
    }
}

/// The weighted mean of independent estimates ε with the standard deviations σ.
#[derive(Debug, Default)]
struct WeightedMean {
    fixes: usize,
    /// Σ 1/σ², Σ ε/σ² and Σ ε²/σ².
    sums: [f64; 3],
}

impl WeightedMean {
    fn add(&mut self, value: f64, sigma: f64) {
        self.fixes += 1;
        let terms = [1.0, value, value * value].map(|term| term * sigma.powi(-2));
        self.sums = std::array::from_fn(|k| self.sums[k] + terms[k]);
    }

    fn mean(&self) -> f64 {
        self.sums[1] / self.sums[0]
    }

    /// The mean over its standard deviation: the stated one, or a larger one by the scatter of the estimates.
    ///
    /// With χ² = Σ (ε − ε̄)²/σ² over n estimates, σ² is multiplied by χ²/(n − 1) if that is above one (Birge 1932).
    fn sigmas(&self) -> f64 {
        let [weight, _, squares] = self.sums;
        let chi2 = squares - weight * self.mean().powi(2);
        let ratio = (chi2 / (self.fixes as f64 - 1.0)).max(1.0);
        self.mean().abs() * (weight / ratio).sqrt()
    }

    fn is_certain(&self) -> bool {
        self.fixes >= MIN_FIXES && self.mean().abs() > MIN && self.sigmas() > SIGMAS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(estimates: &[(f64, f64)]) -> WeightedMean {
        let mut mean = WeightedMean::default();
        estimates.iter().for_each(|(value, sigma)| mean.add(*value, *sigma));
        mean
    }

    /// 4 % thrice with σ 1 %: 0.04 √3/0.01. Estimates of 2, 4 and 6 % scatter with σ 2 %: half as many.
    ///
    /// Fails without the scatter.
    #[test]
    fn estimates_that_scatter_are_less_certain() {
        let alike = of(&[(0.04, 0.01); 3]);
        assert!((alike.sigmas() - 4.0 * 3f64.sqrt()).abs() < 1e-9 && alike.is_certain());
        let scattered = of(&[(0.02, 0.01), (0.04, 0.01), (0.06, 0.01)]);
        assert!((scattered.mean() - 0.04).abs() < 1e-12 && (scattered.sigmas() - 2.0 * 3f64.sqrt()).abs() < 1e-9);
        assert!(!scattered.is_certain() && !of(&[(0.04, 0.001); 2]).is_certain());
    }

    /// A depth error of the focal length is named before the scale error that it causes, a baseline's scale error before
    /// the depth error.
    #[test]
    fn the_more_significant_error_is_named() {
        let named = |scale: f64, depth: f64| {
            let mean = |value: f64| of(&[(value, 0.002); 4]);
            ScaleErrors { scale: mean(scale), depth: mean(depth) }.warning()
        };
        assert_eq!(named(0.005, 0.005), None);
        assert!(
            named(0.02, 0.05).is_some_and(|said| said.starts_with("distances along the optical axis are 5.0 % longer"))
        );
        assert!(named(-0.05, -0.02).is_some_and(|said| said.starts_with("measured distances are 5.0 % shorter")));
    }
}
