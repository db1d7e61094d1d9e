//! Summary statistics of errors.

use crate::statistics::quantile;

/// Statistics of errors, by evo's names; all NaN without errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Root mean square error.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation about the mean (of the population, as in evo).
    pub std: f64,
    /// Minimum.
    pub min: f64,
    /// Maximum.
    pub max: f64,
    /// Sum of squared errors.
    pub sse: f64,
    /// 75 % quantile.
    pub p75: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// 99 % quantile.
    pub p99: f64,
    /// Number of errors.
    pub pairs: usize,
}

impl Summary {
    /// The statistics of `errors`.
    pub fn of(errors: &[f64]) -> Self {
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let sse: f64 = errors.iter().map(|e| e * e).sum();
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let mut at = |p: f64| quantile(&mut sorted, p);
        Self {
            rmse: (sse / n).sqrt(),
            mean,
            median: at(0.5),
            std: (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n).sqrt(),
            min: at(0.0),
            max: at(1.0),
            sse,
            p75: at(0.75),
            p95: at(0.95),
            p99: at(0.99),
            pairs: errors.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_errors_by_hand() {
        let summary = Summary::of(&[3.0, 1.0, 2.0]);
        assert_eq!((summary.mean, summary.median, summary.min, summary.max), (2.0, 2.0, 1.0, 3.0));
        assert_eq!((summary.sse, summary.pairs), (14.0, 3));
        assert!((summary.rmse - (14.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((summary.std - (2.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(Summary::of(&[]).rmse.is_nan());
    }
}
