//! Confidence intervals of rates.

use statrs::distribution::{Beta, ContinuousCDF};

/// The exact confidence interval of a rate of `k` events in `n` trials (Clopper and Pearson, 1934).
///
/// The bounds are quantiles of beta distributions: B(α/2; k, n−k+1) and B(1−α/2; k+1, n−k), α = 1 − `confidence`. The
/// interval is (0, 1) without trials.
///
/// ```
/// let (low, high) = seafix_evaluation::clopper_pearson(0, 299, 0.90);
/// assert_eq!(low, 0.0);
/// assert!((high - 0.01).abs() < 1e-4); // no event in 299 trials: below 1 % with 95 % one-sided confidence
/// ```
pub fn clopper_pearson(k: usize, n: usize, confidence: f64) -> (f64, f64) {
    real_clopper_pearson(k as f64, n as f64, confidence)
}

/// The Clopper–Pearson interval of an effective, possibly fractional number of trials.
pub(super) fn real_clopper_pearson(k: f64, n: f64, confidence: f64) -> (f64, f64) {
    let alpha = 1.0 - confidence;
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).expect("both shape parameters are positive").inverse_cdf(p);
    let low = if k <= 0.0 { 0.0 } else { quantile(k, n - k + 1.0, 0.5 * alpha) };
    let high = if k >= n { 1.0 } else { quantile(k + 1.0, n - k, 1.0 - 0.5 * alpha) };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_the_textbook_interval() {
        // R: binom.test(12, 13)$conf.int
        let (low, high) = clopper_pearson(12, 13, 0.95);
        assert!((low - 0.6397).abs() < 1e-4 && (high - 0.998_05).abs() < 1e-4, "{low} {high}");
        assert_eq!(clopper_pearson(0, 0, 0.95), (0.0, 1.0));
        assert_eq!(clopper_pearson(5, 5, 0.95).1, 1.0);
    }
}
