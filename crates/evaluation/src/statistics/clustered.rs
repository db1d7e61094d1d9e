//! Confidence intervals of proportions over correlated trials.

use super::rate::real_clopper_pearson;

/// The confidence interval of the fraction of events in a series of correlated trials.
///
/// It is the [`clopper_pearson`](super::clopper_pearson) interval of the effective number of trials n/d (Korn and
/// Graubard, Confidence intervals for proportions with small expected number of positive counts estimated from survey
/// data, 1998). The design effect d = V_b / (b p (1 − p)) is the ratio of variances: sums of `block` consecutive
/// events, over all starts on a circle, against sums of independent events. With m runs of the rarer outcome its
/// relative uncertainty is √(2/m), and d is increased by this fraction; it is at least 1 and at most the block length.
/// If all trials are events, or none, every block counts as one trial. The interval is (NaN, NaN) without trials.
///
/// ```
/// use seafix_evaluation::{clopper_pearson, clustered};
/// assert_eq!(clustered(&[true; 40], 4, 0.95), clopper_pearson(10, 10, 0.95));
/// // Alternating events: block sums do not vary, but the effective number of trials never exceeds the actual one.
/// let events: Vec<bool> = (0..400).map(|i| i % 2 == 0).collect();
/// let (low, high) = clustered(&events, 4, 0.95);
/// assert!((0.444..0.45).contains(&low) && (0.55..0.556).contains(&high));
/// ```
pub fn clustered(events: &[bool], block: usize, confidence: f64) -> (f64, f64) {
    let n = events.len();
    if n == 0 {
        return (f64::NAN, f64::NAN);
    }
    let block = block.clamp(1, n);
    let k = events.iter().filter(|event| **event).count();
    let effective = n as f64 / design_effect(events, k, block);
    real_clopper_pearson(effective * k as f64 / n as f64, effective, confidence)
}

/// The confidence interval of `k` events in `n` correlated trials of unknown order.
///
/// Every `block` trials count as one trial of [`clopper_pearson`](super::clopper_pearson). The interval is (0, 1)
/// without trials.
pub fn of_blocks(k: usize, n: usize, block: usize, confidence: f64) -> (f64, f64) {
    let block = block.clamp(1, n.max(1)) as f64;
    real_clopper_pearson(k as f64 / block, n as f64 / block, confidence)
}

/// The design effect, between 1 and the block length; `k` trials are events.
pub(super) fn design_effect(events: &[bool], k: usize, block: usize) -> f64 {
    let n = events.len();
    let (longest, fraction) = (block as f64, k as f64 / n as f64);
    let rarer = 2 * k <= n;
    let runs = (0..n).filter(|&i| events[i] == rarer && (i == 0 || events[i - 1] != rarer)).count();
    if runs == 0 {
        return longest;
    }
    let mut sum = events[..block].iter().filter(|event| **event).count();
    let mut square = 0.0;
    for begin in 0..n {
        square += (sum as f64 - longest * fraction).powi(2);
        sum = sum + usize::from(events[(begin + block) % n]) - usize::from(events[begin]);
    }
    let alone = longest * fraction * (1.0 - fraction);
    let found = (square / n as f64 / alone).max(1.0);
    (found * (1.0 + (2.0 / runs as f64).sqrt())).min(longest)
}

#[cfg(test)]
mod tests {
    use rand_chacha::{
        ChaCha8Rng,
        rand_core::{Rng, SeedableRng},
    };

    use super::*;
    use crate::statistics::rate::clopper_pearson;

    #[test]
    fn few_events_give_wide_intervals_that_hold_the_observed_fraction() {
        // Three separate events in seven trials, blocks of two: the effective number of trials is 1.8 times smaller.
        let (low, high) = clustered(&[true, false, true, false, true, false, false], 2, 0.95);
        assert!(low > 0.02 && low < 0.1 && high > 0.8 && high < 0.95, "{low} {high}");
        assert_eq!(clustered(&[false; 9], 3, 0.95), clopper_pearson(0, 3, 0.95));
        assert!(clustered(&[], 3, 0.95).0.is_nan());
        assert_eq!(clustered(&[true], 5, 0.95), clopper_pearson(1, 1, 0.95));
    }

    /// Runs of ten equal events count as one trial each; the interval has its nominal coverage.
    ///
    /// The test fails with a design effect of one.
    #[test]
    fn events_that_come_in_runs_are_no_surer_than_their_runs() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for fraction in [0.5, 0.9] {
            let mut held = 0;
            for _ in 0..1000 {
                let runs = (0..60).map(|_| (random.next_u64() as f64) < fraction * 2f64.powi(64));
                let events: Vec<bool> = runs.flat_map(|event| [event; 10]).collect();
                let (low, high) = clustered(&events, 20, 0.95);
                held += usize::from(low <= fraction && fraction <= high);
            }
            assert!(held > 930, "{fraction}: {held} of 1000");
        }
    }
}
