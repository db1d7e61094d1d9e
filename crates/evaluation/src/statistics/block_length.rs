//! The block length of a bootstrap, from the autocorrelation.

/// The block length of the circular block bootstrap of a mean of n dependent values (Politis and White).
///
/// It is (3/2 · (G/g)² · n)^⅓ with g = Σ λ(k/m) r(k) and G = Σ λ(k/m) |k| r(k) over −m ≤ k ≤ m, where r is the
/// autocovariance and λ the flat-top window, 1 up to a half and then falling to 0 at 1. The number of lags m is twice the
/// lag after which max(5, ⌊log₁₀ n⌋) successive autocorrelations stay below 2 √(log₁₀ n / n), or ⌈√n⌉ more than that run
/// if none do. The length is at least 1 and at most ⌈min(3 √n, n/3)⌉: a series with a longer dependence has too short an
/// interval. Constant series, and those of fewer than ten values, have length 1.
///
/// Sources: Politis and White, *Automatic block-length selection for the dependent bootstrap*, 2004, with the correction
/// of Patton, Politis and White, 2009.
///
/// ```
/// // Runs of twenty equal values are one block each, or more than that.
/// let values: Vec<f64> = (0..400).map(|i| f64::from((i / 20 + 3_i32).pow(3) % 101)).collect();
/// assert!((15..60).contains(&seafix_evaluation::block_length(&values)));
/// ```
pub fn block_length(values: &[f64]) -> usize {
    let n = values.len();
    if n < MIN {
        return 1;
    }
    let real = n as f64;
    let mean = values.iter().sum::<f64>() / real;
    let off: Vec<f64> = values.iter().map(|value| value - mean).collect();
    let run = ((real.log10()) as usize).max(5);
    let lags = real.sqrt().ceil() as usize + run;
    // With few values the window is wider than the series.
    let lags = lags.min(n - 2);
    let cross = |lag: usize| off[lag..].iter().zip(&off).map(|(a, b)| a * b).sum::<f64>();
    let square = |part: &[f64]| part.iter().map(|value| value * value).sum::<f64>();
    let covariances: Vec<f64> = (0..=lags).map(|lag| cross(lag) / real).collect();
    let spread = covariances[0];
    if spread.is_nan() || spread <= 0.0 {
        return 1;
    }
    let limit = 2.0 * (real.log10() / real).sqrt();
    let small: Vec<bool> = (0..=lags)
        .map(|lag| {
            let scale = (square(&off[lag + 1..]) * square(&off[..n - lag - 1])).sqrt();
            (cross(lag) / scale).abs() < limit
        })
        .collect();
    let quiet = (0..=lags - run.min(lags)).find(|&first| small[first..].iter().take(run).all(|small| *small));
    let width = quiet.map_or(lags, |lag| (2 * lag.max(1)).min(lags));
    let window = |lag: usize| (2.0 * (1.0 - lag as f64 / width as f64)).min(1.0);
    let (mut level, mut slope) = (spread, 0.0);
    for (lag, covariance) in covariances.iter().enumerate().take(width + 1).skip(1) {
        level += 2.0 * window(lag) * covariance;
        slope += 2.0 * window(lag) * lag as f64 * covariance;
    }
    let longest = (3.0 * real.sqrt()).min(real / 3.0).ceil();
    let length = (1.5 * (slope / level).powi(2) * real).cbrt();
    // A long-run variance of zero asks for the longest blocks.
    (if length.is_finite() { length.clamp(1.0, longest) } else { longest }).round() as usize
}

/// Minimum number of values: fewer have no autocorrelation over a run of five lags.
const MIN: usize = 10;

#[cfg(test)]
mod tests {
    use rand_chacha::{
        ChaCha8Rng,
        rand_core::{Rng, SeedableRng},
    };

    use super::*;
    use crate::statistics::bootstrap::Bootstrap;

    /// A first-order autoregression of uniform numbers.
    fn series(n: usize, rho: f64) -> Vec<f64> {
        let uniform = (0..n as u64).map(|i| ((i * i * 40_503 + 12_345) % 65_537) as f64 / 65_537.0 - 0.5);
        let next = |state: &mut f64, value| {
            *state = rho * *state + value;
            Some(*state)
        };
        uniform.scan(0.0, next).collect()
    }

    /// The lengths of `arch.bootstrap.optimal_block_length` (arch 7.2), rounded.
    #[test]
    fn lengths_are_those_of_arch() {
        let known = [(200, 0.0, 1), (200, 0.5, 6), (1000, 0.9, 47), (600, 0.98, 46), (37, 0.8, 4), (12, 0.3, 1)];
        for (n, rho, length) in known {
            assert_eq!(block_length(&series(n, rho)), length, "{n} {rho}");
        }
        assert_eq!([block_length(&[]), block_length(&[2.0; 50]), block_length(&[1.0, 2.0])], [1; 3]);
    }

    /// The interval of a root mean square of correlated errors covers it nearly as often as it states.
    #[test]
    fn an_interval_over_these_blocks_covers_a_root_mean_square() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let (rho, n, trials) = (0.9_f64, 800, 200);
        let mut held = 0;
        for seed in 0..trials {
            // Sums of twelve uniform numbers are nearly normal, of variance 1.
            let mut normal = || (0..12).map(|_| random.next_u64() as f64 / 2f64.powi(64)).sum::<f64>() - 6.0;
            let mut state = normal() / (1.0 - rho * rho).sqrt();
            let squares: Vec<f64> = (0..n)
                .map(|_| {
                    state = rho * state + normal();
                    state * state
                })
                .collect();
            let bootstrap = Bootstrap { resamples: 200, block: block_length(&squares), seed };
            let (low, high) = bootstrap.interval(n, 0.95, |at| at.iter().map(|&i| squares[i]).sum::<f64>() / n as f64);
            let variance = 1.0 / (1.0 - rho * rho);
            held += usize::from(low <= variance && variance <= high);
        }
        assert!(held * 100 >= trials as usize * 84, "{held} of {trials}");
    }
}
