//! Differences of rates and of values between two samples, with their intervals.
//!
//! Attempts on the same frames are compared in pairs: what both have in common, such as a difficult view, cancels. Two
//! intervals that overlap say little: the difference may be significant all the same.

use super::{
    clustered::of_blocks,
    quantile::{median, quantile},
    rate::real_clopper_pearson,
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
    /// With d of n trials in which only one event happens, a of them the first, it is (d/n)(2a/d − 1). The interval follows
    /// from that of a/d by Clopper and Pearson, which is the inversion of McNemar's exact test. Successive trials depend on
    /// each other: of those in one block of `block` trials all count as one, and `block` 1 are independent trials. Without
    /// such a trial the interval is that of no event in n.
    ///
    /// ```
    /// use seafix_evaluation::Difference;
    /// let pairs: Vec<(bool, bool)> = (0..40).map(|i| (true, i >= 6)).collect();
    /// let found = Difference::of_rates(&pairs, 1, 0.95); // six trials against none: p = 2 · 2⁻⁶ = 0.031
    /// assert!(found.value == 0.15 && found.significant());
    /// ```
    pub fn of_rates(pairs: &[(bool, bool)], block: usize, confidence: f64) -> Self {
        let (n, block) = (pairs.len(), block.max(1));
        let alone = |a: bool| pairs.iter().filter(|pair| **pair == (a, !a)).count();
        let (first, second) = (alone(true), alone(false));
        let d = first + second;
        if d == 0 {
            let high = of_blocks(0, n, block, confidence).1;
            return Self { value: 0.0, interval: [-high, high], pairs: Some(n) };
        }
        let blocks = pairs.chunks(block).filter(|block| block.iter().any(|(a, b)| a != b)).count() as f64;
        let part = first as f64 / d as f64;
        let (low, high) = real_clopper_pearson(part * blocks, blocks, confidence);
        let of = |part: f64| d as f64 / n as f64 * (2.0 * part - 1.0);
        Self { value: of(part), interval: [of(low), of(high)], pairs: Some(n) }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// McNemar's exact test of 6 against 0 gives p = 2 · 2⁻⁶ = 0.031, of 5 against 0 it gives 0.063.
    ///
    /// Seen to fail where the interval is that of the rate of the first alone.
    #[test]
    fn the_difference_of_rates_inverts_the_exact_test() {
        let pairs =
            |only: usize, both: usize| -> Vec<(bool, bool)> { (0..only + both).map(|i| (true, i >= only)).collect() };
        let (six, five) = (pairs(6, 34), pairs(5, 35));
        assert!(Difference::of_rates(&six, 1, 0.95).significant());
        assert!(!Difference::of_rates(&five, 1, 0.95).significant());
        // In blocks of three, six successive trials are two.
        assert!(!Difference::of_rates(&six, 3, 0.95).significant());
        let apart: Vec<(bool, bool)> = (0..40).map(|i| (true, i % 6 != 0)).collect();
        assert!(Difference::of_rates(&apart, 3, 0.95).significant(), "seven blocks of three have one each");
        // Nothing differs: the rule of three bounds the difference by about 3/n on both sides.
        let [low, high] = Difference::of_rates(&pairs(0, 100), 1, 0.95).interval;
        assert!(low == -high && (0.03..0.04).contains(&high), "{high}");
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
