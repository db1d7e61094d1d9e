//! Intervals without a model of the distribution: the bootstrap over blocks.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

use super::quantile;

/// The percentile bootstrap over blocks of consecutive values (Politis and Romano, A circular block-resampling
/// procedure for stationary data, 1992).
///
/// Neighbouring frames of a trajectory are not independent: whole blocks of `block` of them are drawn with
/// replacement, their begin uniform over all n places of a circle, until n values are together. `block` 1 is Efron's
/// bootstrap of independent values. What is drawn are *places*: a paired statistic takes the same places out of
/// both samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// How often the statistic is drawn.
    pub resamples: usize,
    /// How many consecutive values stay together; at least one.
    pub block: usize,
    /// Of the random numbers: the same seed gives the same interval on every machine.
    pub seed: u64,
}

impl Bootstrap {
    /// Ten thousand resamples of n values, in blocks of ⌈n^⅓⌉ (the order that is optimal for a variance: Hall, Horowitz
    /// and Jing, 1995).
    pub fn of(n: usize, seed: u64) -> Self {
        let block = (1..=n.max(1)).find(|block| block * block * block >= n).unwrap_or(1);
        Self { resamples: 10_000, block, seed }
    }

    /// The interval that holds `statistic` of n values with this confidence, by its α/2 and 1 − α/2 quantiles over the
    /// resamples, α = 1 − `confidence`; NaN where n is zero.
    ///
    /// `statistic` is given the places of one resample, n of 0..n.
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
        let mut drawn: Vec<f64> = (0..self.resamples.max(1))
            .map(|_| {
                for block in places.chunks_mut(self.block.max(1)) {
                    // The upper half of a 128-bit product: uniform up to n / 2⁶⁴.
                    let begin = ((u128::from(random.next_u64()) * n as u128) >> 64) as usize;
                    block.iter_mut().enumerate().for_each(|(step, place)| *place = (begin + step) % n);
                }
                statistic(&places)
            })
            .collect();
        let alpha = 1.0 - confidence;
        (quantile(&mut drawn, 0.5 * alpha), quantile(&mut drawn, 1.0 - 0.5 * alpha))
    }
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
