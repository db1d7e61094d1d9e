//! Differences of rates and of values between two samples, with their intervals.
//!
//! Attempts on the same frames are compared in pairs: what both have in common, such as a difficult view, cancels. Two
//! intervals that overlap say little: the difference may be significant all the same.

use statrs::distribution::{ContinuousCDF, Normal};

use super::{
    clustered::{design_effect, of_blocks},
    quantile::{median, quantile},
};

/// A difference first − second with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// The difference, in the unit of the values; of rates as a fraction.
    pub value: f64,
    /// The ends of its interval.
    pub interval: [f64; 2],
    /// The number of pairs; `None` for independent samples.
    pub pairs: Option<usize>,
}

impl Difference {
    /// The difference of the rates of two events over the same trials, in order of time; zero and (−1, 1) without trials.
    ///
    /// Of n trials only the first event happens in b, only the second in c; the difference is (b − c)/n. The interval holds
    /// each δ that the score test of Tango does not reject: (b − c − n δ)² ≤ z² n (2 q + δ (1 − δ)), where q is the most
    /// likely probability of "only the second" under δ. At δ = 0 it is McNemar's test. Successive trials depend on each other:
    /// all counts are divided by the design effect of [`clustered`](super::clustered) for the trials with one event only,
    /// with blocks of `block` trials; `block` 1 are independent trials.
    ///
    /// Source: Tango, *Equivalence test and confidence interval for the difference in proportions for the paired-sample
    /// design*, Statistics in Medicine 17, 1998.
    ///
    /// ```
    /// use seafix_evaluation::Difference;
    /// let pairs: Vec<(bool, bool)> = (0..40).map(|i| (true, i >= 6)).collect();
    /// let found = Difference::of_rates(&pairs, 1, 0.95); // six trials against none: z = √6
    /// assert!(found.value == 0.15 && found.significant());
    /// ```
    pub fn of_rates(pairs: &[(bool, bool)], block: usize, confidence: f64) -> Self {
        let n = pairs.len();
        if n == 0 {
            return Self { value: 0.0, interval: [-1.0, 1.0], pairs: Some(0) };
        }
        let alone: Vec<bool> = pairs.iter().map(|(a, b)| a != b).collect();
        let count = |pair: (bool, bool)| pairs.iter().filter(|own| **own == pair).count() as f64;
        let d = alone.iter().filter(|alone| **alone).count();
        let effect = design_effect(&alone, d, block.clamp(1, n));
        let [b, c, n_effective] = [count((true, false)), count((false, true)), n as f64].map(|count| count / effect);
        let z = Normal::standard().inverse_cdf(0.5 + 0.5 * confidence);
        let value = (b - c) / n_effective;
        // The score falls as δ grows.
        let end = |target: f64, mut low: f64, mut high: f64| {
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if score([b, c, n_effective], middle) > target { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        };
        Self { value, interval: [end(z, -1.0, value), end(-z, value, 1.0)], pairs: Some(n) }
    }

    /// The median difference of two values of the same trials; `None` without trials.
    ///
    /// The ends of its interval are the quantiles at the ends of the interval of one half: it assumes nothing about the
    /// distribution. Every `block` trials count as one.
    pub fn of_values(pairs: &[(f64, f64)], block: usize, confidence: f64) -> Option<Self> {
        let mut differences: Vec<f64> = pairs.iter().map(|(a, b)| a - b).collect();
        let n = differences.len();
        let ends = [of_blocks(n / 2, n, block, confidence).0, of_blocks(n - n / 2, n, block, confidence).1];
        (n > 0).then(|| Self {
            value: median(&mut differences),
            interval: ends.map(|end| quantile(&mut differences, end)),
            pairs: Some(n),
        })
    }

    /// The difference of two independent values by their intervals, each `[value, low, high]`.
    ///
    /// Its ends are a − b − √((a − low_a)² + (high_b − b)²) and a − b + √((high_a − a)² + (b − low_b)²).
    ///
    /// Source: Zou and Donner, *Construction of confidence limits about effect measures*, Statistics in Medicine 27, 2008.
    pub fn of_independent([a, low_a, high_a]: [f64; 3], [b, low_b, high_b]: [f64; 3]) -> Self {
        let value = a - b;
        let interval = [value - (a - low_a).hypot(high_b - b), value + (high_a - a).hypot(b - low_b)];
        Self { value, interval, pairs: None }
    }

    /// Whether the interval excludes zero.
    pub fn significant(&self) -> bool {
        self.interval[0] > 0.0 || self.interval[1] < 0.0
    }
}

/// Tango's score of the difference δ for `[b, c, n]`.
fn score([b, c, n]: [f64; 3], delta: f64) -> f64 {
    let (second, third) = ((2.0 * n - b + c) * delta - b - c, -c * delta * (1.0 - delta));
    let q = ((second * second - 8.0 * n * third).max(0.0).sqrt() - second) / (4.0 * n);
    let variance = n * (2.0 * q + delta * (1.0 - delta));
    let excess = b - c - n * delta;
    if excess == 0.0 { 0.0 } else { excess / variance.max(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ends solve the score equation, with q at the maximum of the likelihood b ln(q + δ) + c ln q + (n − b − c)
    /// ln(1 − 2q − δ), here found by trying all.
    ///
    /// Seen to fail where q is c/n.
    #[test]
    fn the_ends_of_the_difference_have_the_score_of_the_level() {
        let pairs: Vec<(bool, bool)> = (0..50).map(|i| (!(12..14).contains(&i), i >= 12)).collect();
        let found = Difference::of_rates(&pairs, 1, 0.95);
        assert!((found.value - 0.2).abs() < 1e-12, "12 against 2 of 50");
        for end in found.interval {
            let likelihood = |q: f64| 12.0 * (q + end).ln() + 2.0 * q.ln() + 36.0 * (1.0 - 2.0 * q - end).ln();
            let possible = (1..100_000).map(|i| f64::from(i) * 5e-6).filter(|q| q + end > 0.0 && 2.0 * q + end < 1.0);
            let q = possible.max_by(|a, b| likelihood(*a).total_cmp(&likelihood(*b))).expect("some q is possible");
            let z = (10.0 - 50.0 * end).abs() / (50.0 * (2.0 * q + end * (1.0 - end))).sqrt();
            assert!((z - 1.959_964).abs() < 1e-3, "{end} {q} {z}");
        }
    }

    #[test]
    fn the_difference_of_rates_is_that_of_mcnemar_s_test() {
        let pairs =
            |only: usize, both: usize| -> Vec<(bool, bool)> { (0..only + both).map(|i| (true, i >= only)).collect() };
        // z = (b − c)/√(b + c) is 2 for four against none, and 1.7 for three.
        assert!(Difference::of_rates(&pairs(4, 36), 1, 0.95).significant());
        assert!(!Difference::of_rates(&pairs(3, 37), 1, 0.95).significant());
        // Six successive trials in blocks of three are two.
        assert!(!Difference::of_rates(&pairs(6, 34), 3, 0.95).significant());
        let apart: Vec<(bool, bool)> = (0..40).map(|i| (true, i % 5 != 0)).collect();
        assert!(Difference::of_rates(&apart, 3, 0.95).significant());
        // Nothing differs: the score interval of no event in n ends at z²/(n + z²).
        let [low, high] = Difference::of_rates(&pairs(0, 100), 1, 0.95).interval;
        let expected = 3.8415 / 103.8415;
        assert!((high - expected).abs() < 1e-4 && (low + expected).abs() < 1e-4, "{low} {high}");
        assert_eq!(Difference::of_rates(&[], 1, 0.95).interval, [-1.0, 1.0]);
    }

    /// The interval of 56/70 − 48/80 by this method with Wilson's intervals is [0.0524, 0.3339].
    ///
    /// Source: Newcombe, *Interval estimation for the difference between independent proportions*, 1998, table II, method
    /// 10.
    #[test]
    fn the_difference_of_independent_rates_is_newcombe_s() {
        let wilson = |k: f64, n: f64| {
            let z: f64 = 1.959_963_985;
            let p = k / n;
            let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
            let centre = p + z * z / (2.0 * n);
            let scale = 1.0 + z * z / n;
            [p, (centre - half) / scale, (centre + half) / scale]
        };
        let found = Difference::of_independent(wilson(56.0, 70.0), wilson(48.0, 80.0));
        let [low, high] = found.interval;
        assert!((low - 0.0524).abs() < 5e-5 && (high - 0.3339).abs() < 5e-5, "{low} {high}");
        assert!((found.value - 0.2).abs() < 1e-12 && found.significant());
    }

    /// The interval of the median of 101 differences has about the ranks 40 and 61, those of the sign test at 95 %.
    #[test]
    fn the_median_difference_has_the_ranks_of_the_sign_test() {
        let pairs: Vec<(f64, f64)> = (1..=101_u32).map(|i| (f64::from(i), 0.0)).collect();
        let found = Difference::of_values(&pairs, 1, 0.95).expect("there are pairs");
        assert_eq!(found.value, 51.0);
        assert!((40.0..42.0).contains(&found.interval[0]) && (60.0..62.0).contains(&found.interval[1]), "{found:?}");
        assert!(Difference::of_values(&[], 1, 0.95).is_none());
    }
}
