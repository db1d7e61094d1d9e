//! Block bootstrap: confidence intervals without a model of the distribution.

use std::sync::{Arc, Mutex, PoisonError};

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

use super::quantile::{median, quantile};

/// Maximum number of blocks; with this number the ends of an interval are accurate to 4 % of its width.
const BLOCKS: usize = 400;
/// Number of values above which the median is found by bisection instead of sorting every resample.
const MANY: usize = 20_000;
/// The last resamples of more than [`MANY`] values: a report requests them repeatedly, from several threads.
static LAST: Mutex<Option<Arc<Resamples>>> = Mutex::new(None);

/// The circular block bootstrap with percentile intervals (Politis and Romano, 1992).
///
/// Neighbouring frames of a trajectory are not independent. A resample consists of blocks of `block` consecutive
/// values, drawn with replacement from uniform starts on a circle of n values, until it has n values. `block` 1 is
/// Efron's bootstrap of independent values. A resample is a list of *indices*, so that a paired statistic uses the same
/// indices in both samples.
///
/// Source: Politis and Romano, *A circular block-resampling procedure for stationary data*, 1992.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// Number of resamples.
    pub resamples: usize,
    /// Length of a block, at least 1.
    pub block: usize,
    /// Seed of the random numbers: the same seed gives the same interval on every machine.
    pub seed: u64,
}

impl Bootstrap {
    /// Ten thousand resamples of n values with a block length of max(⌈n^⅓⌉, n / 400).
    ///
    /// The order n^⅓ is optimal for a variance (Hall, Horowitz and Jing, 1995).
    pub fn of(n: usize, seed: u64) -> Self {
        let block = (1..=n.max(1)).find(|block| block * block * block >= n).unwrap_or(1).max(n.div_ceil(BLOCKS));
        Self { resamples: 10_000, block, seed }
    }

    /// The confidence interval of `statistic` over n values: its α/2 and 1 − α/2 quantiles over the resamples.
    ///
    /// α is 1 − `confidence`. The interval is NaN if n is zero. `statistic` receives the indices of one resample, n
    /// numbers in 0..n.
    ///
    /// ```
    /// use seafix_evaluation::{Bootstrap, median};
    /// let values = [3.0, 5.0, 4.0, 6.0, 5.5, 4.5, f64::INFINITY]; // one failure
    /// let middle = |at: &[usize]| median(&mut at.iter().map(|&i| values[i]).collect::<Vec<_>>());
    /// let (low, high) = Bootstrap { resamples: 1000, block: 1, seed: 1 }.interval(values.len(), 0.95, middle);
    /// assert!(low <= 5.0 && 5.0 <= high);
    /// ```
    pub fn interval(&self, n: usize, confidence: f64, mut statistic: impl FnMut(&[usize]) -> f64) -> (f64, f64) {
        if n == 0 {
            return (f64::NAN, f64::NAN);
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut places = vec![0; n];
        let mut sampled: Vec<f64> = (0..self.resamples.max(1))
            .map(|_| {
                for block in places.chunks_mut(self.block.max(1)) {
                    let begin = place_below(n, &mut random);
                    block.iter_mut().enumerate().for_each(|(step, place)| *place = (begin + step) % n);
                }
                statistic(&places)
            })
            .collect();
        let alpha = 1.0 - confidence;
        (quantile(&mut sampled, 0.5 * alpha), quantile(&mut sampled, 1.0 - 0.5 * alpha))
    }

    /// The confidence interval of the median of `values`.
    ///
    /// Above 20 000 values no resample is sorted: the median of a resample is at most v if half of its values are, and
    /// block sums count these. The ends are then values, not means of two neighbours.
    pub fn median(&self, values: &[f64], confidence: f64) -> (f64, f64) {
        if values.len() <= MANY {
            let mut sampled = Vec::with_capacity(values.len());
            return self.interval(values.len(), confidence, |at| {
                sampled.clear();
                sampled.extend(at.iter().map(|&i| values[i]));
                median(&mut sampled)
            });
        }
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let half = values.len().div_ceil(2);
        let sampled = self.draw(values.len());
        // The smallest value that the median exceeds in at most 1 − `fraction` of the resamples.
        let end = |fraction: f64| {
            let wanted = fraction * self.resamples.max(1) as f64;
            let (mut low, mut high) = (0, sorted.len() - 1);
            while low < high {
                let middle = low.midpoint(high);
                let below = |value: &f64| value.total_cmp(&sorted[middle]).is_le();
                let sums = sampled.sums(values.iter().map(below));
                match sums.into_iter().filter(|sum| *sum >= half).count() as f64 >= wanted {
                    true => high = middle,
                    false => low = middle + 1,
                }
            }
            sorted[low]
        };
        let alpha = 1.0 - confidence;
        (end(0.5 * alpha), end(1.0 - 0.5 * alpha))
    }

    /// The blocks of every resample of n > 0 values.
    fn draw(&self, n: usize) -> Arc<Resamples> {
        if n <= MANY {
            return Arc::new(self.sampled(n));
        }
        let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some(sampled) if sampled.of == (*self, n) => Arc::clone(sampled),
            _ => {
                // The old resamples are dropped first: two sets at once would be the peak memory of a report.
                *last = None;
                Arc::clone(last.insert(Arc::new(self.sampled(n))))
            }
        }
    }

    fn sampled(&self, n: usize) -> Resamples {
        let block = self.block.clamp(1, n);
        let resamples = self.resamples.max(1);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let full = n / block;
        let mut begins = Vec::with_capacity(resamples * full);
        let mut rest = Vec::new();
        for resample in 0..resamples as u64 {
            begins.extend((0..full).map(|_| (place_below(n, &mut random) as u64) << 32 | resample));
            if !n.is_multiple_of(block) {
                rest.push(place_below(n, &mut random));
            }
        }
        begins.sort_unstable();
        Resamples { of: (*self, n), block, begins, rest }
    }
}

/// The blocks of all resamples, sorted by their start: sums then read the values in order.
#[derive(Debug)]
struct Resamples {
    /// The bootstrap and the number of values of this set.
    of: (Bootstrap, usize),
    /// The block length.
    block: usize,
    /// Start and resample of every full block in 32 bits each; no memory holds more values than 32 bits count.
    begins: Vec<u64>,
    /// Start of each resample's last block, if it is shorter.
    rest: Vec<usize>,
}

impl Resamples {
    /// The number of events in each resample.
    fn sums(&self, events: impl Iterator<Item = bool>) -> Vec<usize> {
        // The number of events before each index.
        let mut before = vec![0_u32];
        before.extend(events.scan(0, |sum, event| {
            *sum += u32::from(event);
            Some(*sum)
        }));
        let (asked, n) = self.of;
        let within = |begin: usize, length: usize| {
            let end = begin + length;
            if end <= n { before[end] - before[begin] } else { before[n] - before[begin] + before[end - n] }
        };
        let mut sums = vec![0_usize; asked.resamples.max(1)];
        for packed in &self.begins {
            sums[*packed as u32 as usize] += within((*packed >> 32) as usize, self.block) as usize;
        }
        for (sum, begin) in sums.iter_mut().zip(&self.rest) {
            *sum += within(*begin, n % self.block) as usize;
        }
        sums
    }
}

/// A random index in 0..n, uniform up to n / 2⁶⁴: the upper half of a 128-bit product.
fn place_below(n: usize, random: &mut ChaCha8Rng) -> usize {
    ((u128::from(random.next_u64()) * n as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_stay_together() {
        let bootstrap = Bootstrap { resamples: 50, block: 4, seed: 3 };
        bootstrap.interval(10, 0.9, |places| {
            assert_eq!(places.len(), 10);
            for block in places.chunks(4) {
                assert!(block.windows(2).all(|pair| pair[1] == (pair[0] + 1) % 10), "{block:?}");
            }
            0.0
        });
        assert_eq!(Bootstrap::of(1000, 1).block, 10);
        assert_eq!(Bootstrap::of(21, 1).block, 3);
        assert_eq!(Bootstrap::of(0, 1).block, 1);
        assert_eq!(Bootstrap::of(1_000_000, 1).block, 2500);
    }

    /// For many values the interval by bisection equals that of the sorted resamples.
    #[test]
    fn the_median_of_many_is_that_of_the_resamples() {
        let n = MANY + 1;
        let values: Vec<f64> = (0..n).map(|i| (i.wrapping_mul(2_654_435_761) % 1009) as f64).collect();
        let bootstrap = Bootstrap { resamples: 39, block: 1000, seed: 2 };
        // With 39 resamples both ends of the 95 % interval are resamples.
        let by_sorting =
            bootstrap.interval(n, 0.95, |at| median(&mut at.iter().map(|&i| values[i]).collect::<Vec<_>>()));
        let by_halving = bootstrap.median(&values, 0.95);
        assert!((by_sorting.0 - by_halving.0).abs() <= 1.0 && (by_sorting.1 - by_halving.1).abs() <= 1.0);
        let few = &values[..31];
        let sorted = bootstrap.interval(31, 0.9, |at| median(&mut at.iter().map(|&i| few[i]).collect::<Vec<_>>()));
        assert_eq!(bootstrap.median(few, 0.9), sorted);
    }

    #[test]
    fn dependent_values_have_wider_intervals() {
        // Runs of ten equal values: 20 independent ones, not 200.
        let values: Vec<f64> = (0..200).map(|i| f64::from((i / 10 + 3_i32).pow(3) % 101)).collect();
        let width = |block| {
            let mean = |at: &[usize]| at.iter().map(|&i| values[i]).sum::<f64>() / at.len() as f64;
            let (low, high) = Bootstrap { resamples: 2000, block, seed: 5 }.interval(200, 0.95, mean);
            high - low
        };
        assert!(width(20) > 2.0 * width(1), "{} {}", width(20), width(1));
    }
}
